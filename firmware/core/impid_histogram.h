/* How often the converter gave which code: what the bench test learns of its noise.
 *
 * Data flow: begin() in the main loop names a source and a number of readings; add() in the sampling
 * interrupt counts them into bins of one code, the first reading in the middle; once none is left the main
 * loop reads the bins. Ownership: the state is the core's. Concurrency: begin() writes while `left` is 0,
 * when add() touches nothing, and sets it last. Timing: a few instructions a reading, one comparison while
 * nothing is asked for. Can fail: a reading beyond the bins is counted as outside.
 */
#ifndef IMPID_HISTOGRAM_H
#define IMPID_HISTOGRAM_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define IMPID_HISTOGRAM_BINS     64u
#define IMPID_HISTOGRAM_READINGS 65535u /* at most: a bin counts that far */

typedef enum {
    IMPID_HISTOGRAM_X = 0,
    IMPID_HISTOGRAM_Y = 1,
    IMPID_HISTOGRAM_REFERENCE = 2, /* the converter's own, if the board reads it */
    IMPID_HISTOGRAM_SOURCES = 3
} impid_histogram_source_t;

typedef struct {
    uint16_t bins[IMPID_HISTOGRAM_BINS];
    uint16_t outside;
    uint16_t base; /* code of the first bin, modulo 2^16 */
    uint8_t source;
    bool based; /* a reading has come */
    _Atomic uint32_t left;
} impid_histogram_t;

void impid_histogram_init(impid_histogram_t *histogram);
/* false, and nothing begins: no such source, or a number of readings that is none or too large. */
bool impid_histogram_begin(impid_histogram_t *histogram, uint32_t source, uint32_t readings);
/* The next reading of this source is wanted. */
bool impid_histogram_wants(const impid_histogram_t *histogram, impid_histogram_source_t source);
void impid_histogram_add(impid_histogram_t *histogram, impid_histogram_source_t source, uint16_t code);
uint32_t impid_histogram_left(const impid_histogram_t *histogram);
/* Readings in a bin; in the one behind the last: those outside. */
uint32_t impid_histogram_bin(const impid_histogram_t *histogram, uint32_t bin);

#endif
