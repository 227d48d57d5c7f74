#include "impid_decimator.h"

#include "impid_assert.h"

#include <string.h>

static const int16_t taps[IMPID_DECIMATOR_TAPS] = {IMPID_DECIMATOR_TAP_VALUES};

void impid_decimator_init(impid_decimator_t *decimator) {
    memset(decimator, 0, sizeof *decimator);
}

void impid_decimator_push(impid_decimator_t *decimator, uint16_t code, uint32_t rail) {
    IMPID_ASSERT(decimator->position < IMPID_DECIMATOR_TAPS);
    decimator->history[decimator->position] = code;
    decimator->history[decimator->position + IMPID_DECIMATOR_TAPS] = code;
    decimator->position = (uint8_t)((decimator->position + 1u) % IMPID_DECIMATOR_TAPS);
    if (decimator->filled < IMPID_DECIMATOR_TAPS) {
        decimator->filled++;
    }
    if (code == 0u || code >= rail) {
        decimator->saturated_for = IMPID_DECIMATOR_TAPS;
    } else if (decimator->saturated_for > 0u) {
        decimator->saturated_for--;
    }
}

bool impid_decimator_ready(const impid_decimator_t *decimator) {
    return decimator->filled == IMPID_DECIMATOR_TAPS;
}

impid_decimator_output_t impid_decimator_output(const impid_decimator_t *decimator, uint32_t bits) {
    /* 65535 times the sum of the taps' magnitudes is 5.0e9: 32 bits would do for 12-bit codes only. */
    const uint16_t *window = &decimator->history[decimator->position];
    uint32_t shift = IMPID_DECIMATOR_SCALE_BITS - (16u - bits); /* the gain to 16 bits is not shifted out */
    int64_t sum = (int64_t)1 << (shift - 1u);
    for (uint32_t i = 0; i < IMPID_DECIMATOR_TAPS; i++) {
        sum += (int64_t)((int32_t)taps[i] * (int32_t)window[i]);
    }
    impid_decimator_output_t output = {.saturated = decimator->saturated_for > 0u};
    if (sum < 0) {
        output.code = 0u;
        output.saturated = true;
    } else if ((sum >> shift) > (int64_t)UINT16_MAX) {
        output.code = UINT16_MAX;
        output.saturated = true;
    } else {
        output.code = (uint16_t)(sum >> shift);
    }
    return output;
}
