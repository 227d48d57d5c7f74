/* What the board does when asked: one command, one answer.
 *
 * Data flow: impid_command_execute() carries a command out on the core and sends its answer on the carrier
 * that it came by. A request repeated on that carrier gets the answer it got before and no second action.
 * PING is exempt: it acts on nothing, and the answer to a repeated ping must tell of the repetition's own
 * arrival, or the host would pair the wrong two instants.
 * Ownership: the core's. Timing: main loop; STOP drains the ring first (at most 256 samples).
 * Can fail: the result code in the answer says how; what makes no sense is counted as rejected.
 */
#ifndef IMPID_COMMAND_H
#define IMPID_COMMAND_H

#include "impid_state.h"

/* t_us: the counter when the command arrived. */
void impid_command_execute(impid_core_t *core, impid_carrier_t carrier,
                           const struct impid_messages_command_t *command, uint32_t t_us);

#endif
