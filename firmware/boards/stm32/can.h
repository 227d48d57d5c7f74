/* The CAN bus: CAN1, frames queued for transmission in their order, commands received by identifier.
 *
 * The controller filters: COMMAND alone reaches its FIFO. It leaves bus-off by itself after 128 times 11
 * recessive bits (ABOM); each time is counted. What was queued stays queued: order and numbering hold.
 */
#ifndef CAN_H
#define CAN_H

#include "impid_core.h"

/* kbps: 1000, 500 or 250. */
void can_start(uint32_t kbps);
/* Main loop: hands commands received to the core. */
void can_poll(impid_core_t *core);
/* Something has arrived that can_poll() would hand over. */
bool can_pending(void);
/* Main loop. false: the queue is full or the controller is off the bus. */
bool can_send(const impid_can_frame_t *frame);
/* How long what is sent now waits. */
uint32_t can_backlog_us(void);
/* For the bench test: off the bus, so many frames go through queue, mailbox, filter and FIFO of this
 * controller alone, each once the one before is back. false: none or too many, or it is under way. */
bool can_loop_start(uint32_t frames);
/* How many came back as they went out, once it is over; UINT32_MAX: under way. */
uint32_t can_looped(void);
/* Adds the bus's part to the account. */
void can_health(impid_port_health_t *health);

#endif
