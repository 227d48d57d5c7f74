/* How far the stream had come: kept in memory that start-up does not clear, so that it outlives a reset.
 *
 * Data flow: the sampling interrupt marks every sample; after a reset the board reads what the boot before
 * had marked last, and LOG tells the host, which can then count what was sampled and never sent.
 * Ownership: the board's; one trace per board. Timing: mark() is two stores; a reset between them is
 * recognised. Can fail: after a loss of power the memory holds random bits, which read() refuses.
 */
#ifndef IMPID_TRACE_H
#define IMPID_TRACE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint32_t boot_id;
    volatile uint32_t produced; /* since START */
    volatile uint32_t check;
} impid_trace_t;

#define IMPID_TRACE_WORDS 3u

void impid_trace_begin(impid_trace_t *trace, uint16_t boot_id);
void impid_trace_mark(impid_trace_t *trace, uint32_t produced);
/* False, and both zero, if this is no trace. */
bool impid_trace_read(const impid_trace_t *trace, uint32_t *boot_id, uint32_t *produced);

#endif
