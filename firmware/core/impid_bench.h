/* What the bench test asks of a board (BENCH): to prove itself with a wire between two of its own pins.
 *
 * Data flow: command -> impid_bench_execute() -> the histogram, which is the core's, or the board's act(), in
 * which the registers are. Ownership: the core's. Timing: main loop; act() does not wait: what takes longer
 * (frames that return, a stop once the answer is out) it begins, and another item tells how it went. Not
 * while samples are taken. Can fail: the result says how.
 */
#ifndef IMPID_BENCH_H
#define IMPID_BENCH_H

#include "impid_histogram.h"

typedef struct {
    void *context;
    /* Carries out an item of BENCH. false: there is no such item, or not with this value. */
    bool (*act)(void *context, uint8_t item, uint32_t value, uint32_t *answer);
} impid_bench_port_t;

typedef struct {
    const impid_bench_port_t *port; /* NULL: this board has nothing beyond the histogram */
    impid_histogram_t histogram;
} impid_bench_t;

void impid_bench_init(impid_bench_t *bench, const impid_bench_port_t *port);
/* false: no such item, or not with this value. */
bool impid_bench_execute(impid_bench_t *bench, uint8_t item, uint32_t value, uint32_t *answer);

#endif
