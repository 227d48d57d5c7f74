/* Which parts of this chip do what, and by which inputs its timers hear each other: RM0390 17.4.3, 18.5.3. */
#ifndef PARTS_H
#define PARTS_H

#include "clock.h"
#include "registers.h"

#define UPPER_TIMER         TIM12
#define UPPER_FROM_TIM4     0u /* ITR0 */
#define ENCODER_1_FROM_TIM3 2u /* ITR2 of TIM2 */
#define ENCODER_2_FROM_TIM3 1u /* ITR1 of TIM5 */
#define TIM3_FROM_TIM4      3u /* ITR3 */

#define REFERENCE_CALIBRATED_AT_MV 3300u

static inline void parts_clock_timers(void) {
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_TIM2 | RCC_APB1ENR_TIM3 | RCC_APB1ENR_TIM4 | RCC_APB1ENR_TIM5 |
                                    RCC_APB1ENR_TIM12);
}

#endif
