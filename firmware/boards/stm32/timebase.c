#include "timebase.h"

#include "clock.h"
#include "parts.h"
#include "registers.h"

/* Eight equal readings: at 90 MHz pulses below 89 ns are ignored, at 144 MHz below 56 ns. */
#define SYNC_FILTER 3u

void timebase_start(void) {
    UPPER_TIMER->SMCR = TIM_SMCR_TS_ITR(UPPER_FROM_TIM4) | TIM_SMCR_SMS_EXTERNAL_1;
    UPPER_TIMER->ARR = UINT16_MAX;

    TIM4->PSC = CLOCK_TIMER_HZ / 1000000u - 1u;
    TIM4->ARR = UINT16_MAX;
    TIM4->CR2 = TIM_CR2_MMS_UPDATE;
    TIM4->CCMR1 = TIM_CCMR1_CC1S_TI1 | TIM_CCMR1_IC1F(SYNC_FILTER);
    TIM4->CCER = TIM_CCER_CC1E;
    TIM4->CR1 = TIM_CR1_CEN;
    /* Clears counter and prescaler; the trigger output of this update starts TIM3. The upper timer is enabled
     * when the trigger is over, a microsecond later, so this update is no overflow to it. */
    TIM4->EGR = TIM_EGR_UG;
    while (TIM4->CNT == 0u) {
    }
    UPPER_TIMER->CR1 = TIM_CR1_CEN;
}

uint32_t timebase_now_us(void) {
    for (;;) {
        uint32_t high = UPPER_TIMER->CNT;
        uint32_t low = TIM4->CNT;
        /* It follows TIM4's overflow by a few clocks: while the low half reads 0 the high one may lag. */
        if (low != 0u && high == UPPER_TIMER->CNT) {
            return (high << 16) | low;
        }
    }
}

uint32_t timebase_as_it_stands(void) {
    return (UPPER_TIMER->CNT << 16) | TIM4->CNT;
}

bool timebase_sync_edge(uint32_t *t_us) {
    if ((TIM4->SR & TIM_SR_CC1IF) == 0u) {
        return false;
    }
    uint32_t captured = TIM4->CCR1; /* reading clears CC1IF */
    /* The second of two edges within a tick may set CC1OF: the tick carries one flag for both. The flags are
     * cleared by writing 0 and left alone by writing 1. */
    TIM4->SR = ~TIM_SR_CC1OF;
    uint32_t now = timebase_now_us();
    *t_us = now - ((now - captured) & UINT16_MAX);
    return true;
}
