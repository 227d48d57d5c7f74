#include "impid_timebase.h"

#include "impid_assert.h"

void impid_timebase_init(impid_timebase_t *timebase, uint64_t now_us) {
    timebase->latest_us = now_us;
}

uint64_t impid_timebase_extend(impid_timebase_t *timebase, uint32_t counter_us) {
    uint32_t ahead = counter_us - (uint32_t)timebase->latest_us;
    if (ahead > UINT32_MAX / 2u) {
        uint64_t earlier_us = timebase->latest_us - (uint32_t)(0u - ahead);
        IMPID_ASSERT((uint32_t)earlier_us == counter_us && earlier_us < timebase->latest_us);
        return earlier_us;
    }
    timebase->latest_us += ahead;
    IMPID_ASSERT((uint32_t)timebase->latest_us == counter_us);
    return timebase->latest_us;
}
