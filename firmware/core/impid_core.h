/* The sensor board without its hardware: everything that is the same on every board.
 *
 * Data flow: impid_core_tick() brings the conversions and counters of one period in; samples wait in a
 * ring; impid_core_poll() brings them out, as frames through the port, to the carriers that asked. Commands
 * come in by the receive functions and are answered before these return.
 * Ownership: the caller owns the context and keeps it at one address; nothing is allocated, nothing is
 * global, so that one process can hold many boards.
 * Timing: tick() and missed() belong to the sampling interrupt (worst case: 56 multiply-adds and one ring
 * slot), everything else to one main loop, which the interrupt may preempt anywhere and never the reverse.
 * poll() is bounded by the ring: at most 256 samples a call. It should run at least every 100 ms.
 * Can fail: nothing returns an error. What goes wrong is counted, and the counters are in STATUS.
 */
#ifndef IMPID_CORE_H
#define IMPID_CORE_H

#include "impid_state.h"

#define IMPID_STATUS_PERIOD_US 100000u

void impid_core_init(impid_core_t *core, const impid_core_config_t *config, const impid_port_t *port);

/* Sampling interrupt. */
void impid_core_tick(impid_core_t *core, const impid_tick_t *tick);
void impid_core_missed(impid_core_t *core, uint32_t ticks);
/* The bench test waits for readings of the converter's reference: one a tick, if the board has them. */
bool impid_core_wants_reference(const impid_core_t *core);
void impid_core_reference(impid_core_t *core, uint16_t code);

/* Main loop. */
void impid_core_poll(impid_core_t *core);
/* t_us: the counter when the last of the bytes arrived. */
void impid_core_serial_receive(impid_core_t *core, const uint8_t *bytes, size_t count, uint32_t t_us);
void impid_core_can_receive(impid_core_t *core, const impid_can_frame_t *frame, uint32_t t_us);

#endif
