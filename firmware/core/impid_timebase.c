#include "impid_timebase.h"

void impid_timebase_init(impid_timebase_t *timebase, uint64_t now_us) {
    timebase->latest_us = now_us;
}

uint64_t impid_timebase_extend(impid_timebase_t *timebase, uint32_t counter_us) {
    uint32_t ahead = counter_us - (uint32_t)timebase->latest_us;
    if (ahead > UINT32_MAX / 2u) {
        return timebase->latest_us - (uint32_t)(0u - ahead);
    }
    timebase->latest_us += ahead;
    return timebase->latest_us;
}
