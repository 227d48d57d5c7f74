#include "clock.h"

#include "board.h"
#include "fault.h"
#include "interrupts.h"
#include "registers.h"

#define HSI_MHZ 16u
/* Both sources are divided to 2 MHz, as RM0390 6.3.2 recommends against jitter; 2 * 180 / 4 = 90 MHz. */
#define PLL_INPUT_MHZ 2u
#define PLL_N         180u
/* Loop turns of at least 6 cycles at 16 MHz: 100 ms or more for a crystal to start. */
#define HSE_ATTEMPTS 270000u
/* The count: TIM11 runs on the internal oscillator, which still is the system clock, and captures every 8th
 * period of HSE_RTC, which is HSE / 8 (RM0390 6.2.11, 18.5.11). */
#define RTC_DIVIDER      8u
#define CAPTURE_DIVIDER  8u
#define CAPTURES         64u
#define CAPTURE_ATTEMPTS 1000u /* of some turns; a capture comes every 8 us */

static uint32_t external_hz;

static bool external_clock_runs(void) {
    if (BOARD_HSE_BYPASS) {
        RCC->CR |= RCC_CR_HSEBYP;
    }
    RCC->CR |= RCC_CR_HSEON;
    for (uint32_t i = 0; i < HSE_ATTEMPTS; i++) {
        if ((RCC->CR & RCC_CR_HSERDY) != 0u) {
            return true;
        }
    }
    RCC->CR &= ~RCC_CR_HSEON;
    RCC->CR &= ~RCC_CR_HSEBYP; /* writable only once HSE is off (RM0390 6.3.1) */
    return false;
}

static bool next_capture(uint32_t *count) {
    for (uint32_t i = 0; i < CAPTURE_ATTEMPTS; i++) {
        uint32_t flags = TIM11->SR;
        if ((flags & TIM_SR_CC1OF) != 0u) {
            return false; /* one was missed: the count would be of more than it says */
        }
        if ((flags & TIM_SR_CC1IF) != 0u) {
            *count = TIM11->CCR1; /* reading clears CC1IF */
            return true;
        }
    }
    return false;
}

/* Half a millisecond, of which one count is 120 ppm: the internal oscillator itself keeps 1 %. */
static uint32_t count_external_clock(void) {
    RCC->CFGR = RTC_DIVIDER << RCC_CFGR_RTCPRE_Pos;
    clock_enable(&RCC->APB2ENR, RCC_APB2ENR_TIM11);
    TIM11->ARR = UINT16_MAX;
    TIM11->OR = TIM11_OR_TI1_HSE_RTC;
    TIM11->CCMR1 = TIM_CCMR1_CC1S_TI1 | TIM_CCMR1_IC1PSC_8;
    TIM11->CCER = TIM_CCER_CC1E;
    TIM11->CR1 = TIM_CR1_CEN;
    uint32_t first = 0;
    uint32_t last = 0;
    bool counted = next_capture(&first);
    for (uint32_t i = 0; i < CAPTURES && counted; i++) {
        counted = next_capture(&last);
    }
    TIM11->CR1 = 0u;
    uint32_t clocks = (last - first) & UINT16_MAX;
    uint64_t periods = (uint64_t)CAPTURES * CAPTURE_DIVIDER * RTC_DIVIDER;
    return counted && clocks > 0u ? (uint32_t)(periods * HSI_MHZ * 1000000u / clocks) : 0u;
}

uint32_t clock_external_hz(void) {
    return external_hz;
}

bool clock_start(void) {
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_PWR);
    PWR->CR = (PWR->CR & ~PWR_CR_VOS_Msk) | PWR_CR_VOS_3;

    bool external = external_clock_runs();
    external_hz = external ? count_external_clock() : 0u;
    uint32_t m = (external ? BOARD_HSE_MHZ : HSI_MHZ) / PLL_INPUT_MHZ;
    RCC->PLLCFGR = m | (PLL_N << RCC_PLLCFGR_N_Pos) | RCC_PLLCFGR_P_4 |
                   (external ? RCC_PLLCFGR_SRC_HSE : 0u) | RCC_PLLCFGR_Q_8 | RCC_PLLCFGR_R_2;
    RCC->CR |= RCC_CR_PLLON;
    /* Unbounded on purpose here and below: without its clock the board is dead, and it says so by silence. */
    while ((RCC->CR & RCC_CR_PLLRDY) == 0u) {
    }
    /* The wait states must be in force before the clock rises (RM0390 3.4.1). */
    FLASH->ACR = FLASH_ACR_LATENCY_2 | FLASH_ACR_PRFTEN | FLASH_ACR_ICEN | FLASH_ACR_DCEN;
    while ((FLASH->ACR & FLASH_ACR_LATENCY_Msk) != FLASH_ACR_LATENCY_2) {
    }
    RCC->CFGR = RCC_CFGR_PPRE1_2;
    RCC->CFGR = RCC_CFGR_PPRE1_2 | RCC_CFGR_SW_PLL;
    while ((RCC->CFGR & RCC_CFGR_SWS_Msk) != RCC_CFGR_SWS_PLL) {
    }
    if (external) {
        /* A clock that dies later raises the NMI instead of silently slowing the time down. */
        RCC->CR |= RCC_CR_CSSON;
    }
    return external;
}

void clock_start_ports(void) {
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_GPIOA | RCC_AHB1ENR_GPIOB | RCC_AHB1ENR_GPIOC);
}

void nmi_handler(void) {
    RCC->CIR |= RCC_CIR_CSSC;
    fault_stop(FAULT_CLOCK_LOST);
}
