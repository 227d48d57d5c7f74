/* The way out of the core: samples from the ring, answers and STATUS, to the carriers.
 *
 * Data flow: state -> records -> link -> port. Ownership: the core's state. Timing: main loop; drain() takes
 * at most 256 samples a call. Can fail: a carrier without room; counted by the link.
 */
#ifndef IMPID_OUTPUT_H
#define IMPID_OUTPUT_H

#include "impid_state.h"

/* The board's time, extended to 64 bits. */
uint64_t impid_output_now_us(impid_core_t *core);
/* One record of 8 bytes as a serial frame of this kind, or as the CAN frame of the message: RESPONSE or PONG.
 */
void impid_output_record(impid_core_t *core, impid_carrier_t carrier, uint8_t kind, const uint8_t *record);
void impid_output_status(impid_core_t *core, impid_carrier_t carrier);
void impid_output_status_everywhere(impid_core_t *core);
/* What waits in the ring goes to the stream, or to the self-test while it runs. */
void impid_output_drain(impid_core_t *core);

#endif
