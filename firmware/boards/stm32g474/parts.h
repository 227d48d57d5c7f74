/* Which parts of this chip do what, and by which inputs its timers hear each other: RM0440, TIMx internal
 * trigger connection, where an input leads to the same timer everywhere. */
#ifndef PARTS_H
#define PARTS_H

#include "clock.h"
#include "registers.h"

#define UPPER_TIMER         TIM15
#define UPPER_FROM_TIM4     3u
#define ENCODER_1_FROM_TIM3 2u
#define ENCODER_2_FROM_TIM3 2u
#define TIM3_FROM_TIM4      3u

#define REFERENCE_CALIBRATED_AT_MV 3000u

static inline void parts_clock_timers(void) {
    clock_enable(&RCC->APB1ENR1,
                 RCC_APB1ENR1_TIM2 | RCC_APB1ENR1_TIM3 | RCC_APB1ENR1_TIM4 | RCC_APB1ENR1_TIM5);
    clock_enable(&RCC->APB2ENR, RCC_APB2ENR_TIM15);
}

#endif
