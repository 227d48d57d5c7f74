#include "impid_bench.h"

#include "impid_messages.h"

void impid_bench_init(impid_bench_t *bench, const impid_bench_port_t *port) {
    bench->port = port;
    impid_histogram_init(&bench->histogram);
}

bool impid_bench_execute(impid_bench_t *bench, uint8_t item, uint32_t value, uint32_t *answer) {
    impid_histogram_t *histogram = &bench->histogram;
    *answer = 0u;
    switch (item) {
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_CHOICE:
        return impid_histogram_begin(histogram, value >> 16, value & UINT16_MAX);
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_LEFT_CHOICE:
        *answer = impid_histogram_left(histogram);
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_BASE_CHOICE:
        *answer = histogram->base;
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_BIN_CHOICE:
        *answer = impid_histogram_bin(histogram, value);
        return value <= IMPID_HISTOGRAM_BINS;
    default:
        return bench->port != NULL && bench->port->act(bench->port->context, item, value, answer);
    }
}
