/* The board's account of itself: every counter that must not stay silent, as the eight STATUS messages.
 *
 * Data flow: the core fills the struct from its parts, pack() makes the 64 bytes of a STATUS record; on
 * CAN the same bytes go out as eight frames, STATUS_BUS last. Ownership: the caller's. Timing: main loop, ten
 * times a second. Can fail: no.
 */
#ifndef IMPID_STATUS_H
#define IMPID_STATUS_H

#include "impid_messages.h"

#include <stdint.h>

#define IMPID_STATUS_MESSAGES 8u
#define IMPID_STATUS_LENGTH   (IMPID_STATUS_MESSAGES * 8u)

typedef struct {
    struct impid_messages_status_samples_t samples;
    struct impid_messages_status_link_t link;
    struct impid_messages_status_timing_t timing;
    struct impid_messages_status_sensors_t sensors;
    struct impid_messages_status_commands_t commands;
    struct impid_messages_status_health_t health;
    struct impid_messages_status_bus_t bus;
    struct impid_messages_status_losses_t losses;
} impid_status_t;

/* Identifier of the message that goes out n-th on CAN, and in `at` its first byte in the record. */
uint16_t impid_status_message_id(uint32_t n, uint32_t *at);
void impid_status_pack(const impid_status_t *status, uint8_t out[IMPID_STATUS_LENGTH]);

#endif
