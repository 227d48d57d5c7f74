#include "impid_decimator.h"

#include "impid_assert.h"

#include <string.h>

/* 12-bit codes to 16-bit codes is a factor 16: that much less is shifted out. */
#define OUTPUT_SHIFT (IMPID_DECIMATOR_SCALE_BITS - 4)

static const int16_t taps[IMPID_DECIMATOR_TAPS] = {IMPID_DECIMATOR_TAP_VALUES};

void impid_decimator_init(impid_decimator_t *decimator) {
    memset(decimator, 0, sizeof *decimator);
}

void impid_decimator_push(impid_decimator_t *decimator, uint16_t code) {
    IMPID_ASSERT(decimator->position < IMPID_DECIMATOR_TAPS);
    decimator->history[decimator->position] = code;
    decimator->history[decimator->position + IMPID_DECIMATOR_TAPS] = code;
    decimator->position = (uint8_t)((decimator->position + 1u) % IMPID_DECIMATOR_TAPS);
    if (decimator->filled < IMPID_DECIMATOR_TAPS) {
        decimator->filled++;
    }
    if (code == 0u || code >= IMPID_ADC_MAX) {
        decimator->saturated_for = IMPID_DECIMATOR_TAPS;
    } else if (decimator->saturated_for > 0u) {
        decimator->saturated_for--;
    }
}

bool impid_decimator_ready(const impid_decimator_t *decimator) {
    return decimator->filled == IMPID_DECIMATOR_TAPS;
}

impid_decimator_output_t impid_decimator_output(const impid_decimator_t *decimator) {
    /* 4095 times the sum of the taps' magnitudes is 3.1e8: 32 bits are enough. */
    const uint16_t *window = &decimator->history[decimator->position];
    int32_t sum = 1 << (OUTPUT_SHIFT - 1);
    for (uint32_t i = 0; i < IMPID_DECIMATOR_TAPS; i++) {
        sum += (int32_t)taps[i] * (int32_t)window[i];
    }
    impid_decimator_output_t output = {.saturated = decimator->saturated_for > 0u};
    if (sum < 0) {
        output.code = 0u;
        output.saturated = true;
    } else if ((sum >> OUTPUT_SHIFT) > (int32_t)UINT16_MAX) {
        output.code = UINT16_MAX;
        output.saturated = true;
    } else {
        output.code = (uint16_t)(sum >> OUTPUT_SHIFT);
    }
    return output;
}
