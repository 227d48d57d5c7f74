/* Decimation of one axis from 8 kHz to 1 kHz by a linear-phase FIR filter in integers.
 *
 * Data flow: impid_decimator_push() takes the conversions one by one, impid_decimator_output() gives the
 * filter's value over the last 28 of them. Codes of `bits` bits in, 12 to 16, 16-bit codes out: a constant
 * input c gives exactly c 2^(16 - bits). Every delay is 13.5 conversions (1687.5 us), whatever the frequency.
 * Ownership: the state is the caller's. Timing: sampling interrupt; 28 multiplications an output.
 * Can fail: no. An output outside 0..65535 (overshoot at a rail) is clipped and reported as saturated,
 * as is every output whose window holds a conversion at 0 or at `rail`.
 */
#ifndef IMPID_DECIMATOR_H
#define IMPID_DECIMATOR_H

#include "impid_decimator_taps.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    uint16_t history[2u * IMPID_DECIMATOR_TAPS]; /* each conversion twice: a window never wraps */
    uint8_t position;                            /* 0..27: where the next conversion goes */
    uint8_t filled;                              /* conversions since init, stops at 28 */
    uint8_t saturated_for; /* further conversions that a saturated one stays in the window */
} impid_decimator_t;

typedef struct {
    uint16_t code;
    bool saturated;
} impid_decimator_output_t;

void impid_decimator_init(impid_decimator_t *decimator);
void impid_decimator_push(impid_decimator_t *decimator, uint16_t code, uint32_t rail);
/* true once the window holds 28 conversions; outputs before that mean nothing. */
bool impid_decimator_ready(const impid_decimator_t *decimator);
impid_decimator_output_t impid_decimator_output(const impid_decimator_t *decimator, uint32_t bits);

#endif
