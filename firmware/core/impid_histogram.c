#include "impid_histogram.h"

#include "impid_assert.h"

#include <string.h>

void impid_histogram_init(impid_histogram_t *histogram) {
    memset(histogram, 0, sizeof *histogram);
}

bool impid_histogram_begin(impid_histogram_t *histogram, uint32_t source, uint32_t readings) {
    if (source >= IMPID_HISTOGRAM_SOURCES || readings == 0u || readings > IMPID_HISTOGRAM_READINGS) {
        return false;
    }
    atomic_store_explicit(&histogram->left, 0u, memory_order_release);
    memset(histogram->bins, 0, sizeof histogram->bins);
    histogram->outside = 0u;
    histogram->source = (uint8_t)source;
    histogram->based = false;
    atomic_store_explicit(&histogram->left, readings, memory_order_release);
    return true;
}

bool impid_histogram_wants(const impid_histogram_t *histogram, impid_histogram_source_t source) {
    return impid_histogram_left(histogram) > 0u && histogram->source == (uint8_t)source;
}

void impid_histogram_add(impid_histogram_t *histogram, impid_histogram_source_t source, uint16_t code) {
    if (!impid_histogram_wants(histogram, source)) {
        return;
    }
    if (!histogram->based) {
        histogram->base = (uint16_t)(code - IMPID_HISTOGRAM_BINS / 2u);
        histogram->based = true;
    }
    uint16_t bin = (uint16_t)(code - histogram->base);
    if (bin < IMPID_HISTOGRAM_BINS) {
        IMPID_ASSERT(histogram->bins[bin] < UINT16_MAX);
        histogram->bins[bin]++;
    } else {
        histogram->outside++;
    }
    /* This context alone counts down. */
    atomic_store_explicit(&histogram->left, impid_histogram_left(histogram) - 1u, memory_order_release);
}

uint32_t impid_histogram_left(const impid_histogram_t *histogram) {
    return atomic_load_explicit(&histogram->left, memory_order_acquire);
}

uint32_t impid_histogram_bin(const impid_histogram_t *histogram, uint32_t bin) {
    return bin < IMPID_HISTOGRAM_BINS ? histogram->bins[bin] : histogram->outside;
}
