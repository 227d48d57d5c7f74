/* One carrier as the board sends on it: numbers every frame, hands it to the port, counts the outcome.
 *
 * Data flow: records (the messages' bytes) in; on the serial line one frame each call, on CAN one frame
 * a message. Ownership: the link belongs to the core; the port copies what it sends.
 * Timing: main loop only; one pass over at most 160 bytes. Can fail: the port has no room; the frame is
 * then dropped and counted, and its number is used up, so that the receiver sees the loss too.
 */
#ifndef IMPID_LINK_H
#define IMPID_LINK_H

#include "impid_frame.h"
#include "impid_port.h"

typedef struct {
    uint32_t frames_sent;
    uint32_t frames_dropped;
    uint16_t frame_seq; /* number of the next serial frame */
} impid_link_t;

/* Packs the header with the link's frame number and sends. true: the port took it. */
bool impid_link_send_serial(impid_link_t *link, const impid_port_t *port,
                            struct impid_messages_batch_t header, const uint8_t *records);
/* `payload` holds 8 bytes. */
bool impid_link_send_can(impid_link_t *link, const impid_port_t *port, uint16_t id, const uint8_t *payload);

#endif
