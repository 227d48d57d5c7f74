/* The 32-bit microsecond counter extended to 64 bits.
 *
 * Data flow: impid_timebase_extend() maps a counter value within +-35 minutes of the last one it saw to
 * the 64-bit time; it accepts values slightly older than the last (stamps of samples that waited).
 * Ownership and concurrency: a timebase belongs to one context and is never shared: the main loop keeps
 * the only one, and the sampling interrupt hands over plain 32-bit stamps. A 64-bit value that two
 * contexts share would tear on a 32-bit machine.
 * Timing: constant. Can fail: silently ambiguous if not called for 35 minutes; the main loop calls it
 * many times a second, and the watchdog bites long before.
 */
#ifndef IMPID_TIMEBASE_H
#define IMPID_TIMEBASE_H

#include <stdint.h>

typedef struct {
    uint64_t latest_us;
} impid_timebase_t;

void impid_timebase_init(impid_timebase_t *timebase, uint64_t now_us);
uint64_t impid_timebase_extend(impid_timebase_t *timebase, uint32_t counter_us);

#endif
