#include "clock.h"

#include "board.h"
#include "registers.h"

#define HSI_MHZ 16u
/* Both sources are divided to 2 MHz, as RM0390 6.3.2 recommends against jitter; 2 * 180 / 4 = 90 MHz. */
#define PLL_INPUT_MHZ 2u
#define PLL_N         180u
/* Loop turns of at least 6 cycles at 16 MHz: 100 ms or more for a crystal to start. */
#define HSE_ATTEMPTS 270000u

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

bool clock_start(void) {
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_PWR);
    PWR->CR = (PWR->CR & ~PWR_CR_VOS_Msk) | PWR_CR_VOS_3;

    bool external = external_clock_runs();
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
