#include "impid_trace.h"

/* Odd, so that every boot gives another check word. */
static uint32_t check_word(uint32_t boot_id, uint32_t produced) {
    return ~produced ^ (boot_id * 0x9E3779B1u);
}

void impid_trace_begin(impid_trace_t *trace, uint16_t boot_id) {
    trace->boot_id = boot_id;
    impid_trace_mark(trace, 0);
}

void impid_trace_mark(impid_trace_t *trace, uint32_t produced) {
    trace->produced = produced;
    trace->check = check_word(trace->boot_id, produced);
}

bool impid_trace_read(const impid_trace_t *trace, uint32_t *boot_id, uint32_t *produced) {
    uint32_t kept = trace->produced;
    bool whole = trace->check == check_word(trace->boot_id, kept);
    bool between_the_stores = trace->check == check_word(trace->boot_id, kept - 1u);
    bool valid = trace->boot_id <= UINT16_MAX && (whole || between_the_stores);
    *boot_id = valid ? trace->boot_id : 0u;
    *produced = valid ? kept : 0u;
    return valid;
}
