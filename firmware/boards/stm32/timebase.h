/* The board's microseconds: 32 bits of hardware, no interrupt involved.
 *
 * TIM4 counts 1 MHz through 16 bits, UPPER_TIMER (parts.h) counts TIM4's overflows. The sampling timer TIM3
 * divides the same clock and is started by TIM4's own update event, so trigger n happens at n * 125 us of
 * this time for ever: the two cannot drift, whatever the software does.
 */
#ifndef TIMEBASE_H
#define TIMEBASE_H

#include <stdbool.h>
#include <stdint.h>

/* Sets the time to zero and, by TIM4's trigger output, starts whatever waits for it. */
void timebase_start(void);
/* Any context. Takes up to 1 us longer within the first microsecond of each 65536. */
uint32_t timebase_now_us(void);
/* Where a fault may have stopped everything else: no loop, so it may be 65536 us off. */
uint32_t timebase_as_it_stands(void);
/* An edge on the sync input since the last call: true, and its time. One caller: the tick. */
bool timebase_sync_edge(uint32_t *t_us);

#endif
