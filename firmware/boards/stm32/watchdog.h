/* The independent watchdog: resets a board whose main loop or whose tick has stopped.
 *
 * Runs on the internal 32 kHz oscillator (17 to 47 kHz): 4000 counts of 1/32 are 2.7 s at the shortest,
 * longer than the longest flash erase (2 s), and 7.5 s at the longest. Once started it cannot be stopped.
 */
#ifndef WATCHDOG_H
#define WATCHDOG_H

#include <registers.h> /* of the chip that is built for */

static inline void watchdog_start(void) {
    IWDG->KR = IWDG_KR_START;
    IWDG->KR = IWDG_KR_UNLOCK;
    IWDG->PR = IWDG_PR_32;
    IWDG->RLR = 4000u;
    IWDG->KR = IWDG_KR_REFRESH;
}

static inline void watchdog_refresh(void) {
    IWDG->KR = IWDG_KR_REFRESH;
}

#endif
