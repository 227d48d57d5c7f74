#include "clock.h"

#include "board.h"
#include "fault.h"
#include "interrupts.h"
#include "registers.h"

#define HSI_MHZ 16u
/* Both sources are divided to 4 MHz; 4 * 72 / 2 = 144 MHz. */
#define PLL_INPUT_MHZ 4u
#define PLL_N         72u
/* Loop turns of at least 6 cycles at 16 MHz: 100 ms or more for a crystal to start. */
#define HSE_ATTEMPTS 270000u
/* Above 80 MHz the bus clock rises in two steps, a microsecond apart at least (RM0440, clock source
 * switching): turns of at least 3 cycles at 72 MHz. */
#define STEP_TURNS 100u

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
    RCC->CR &= ~RCC_CR_HSEBYP;
    return false;
}

static void wait_a_microsecond(void) {
    for (uint32_t i = 0; i < STEP_TURNS; i++) {
        __asm volatile("nop");
    }
}

bool clock_start(void) {
    clock_enable(&RCC->APB1ENR1, RCC_APB1ENR1_PWR);
    /* PB6 and PB4 carry pull-downs for USB power delivery from reset on, until this. */
    PWR->CR3 |= PWR_CR3_UCPD1_DBDIS;

    bool external = external_clock_runs();
    uint32_t m = (external ? BOARD_HSE_MHZ : HSI_MHZ) / PLL_INPUT_MHZ;
    RCC->PLLCFGR = (external ? RCC_PLLCFGR_SRC_HSE : RCC_PLLCFGR_SRC_HSI) | ((m - 1u) << RCC_PLLCFGR_M_Pos) |
                   (PLL_N << RCC_PLLCFGR_N_Pos) | RCC_PLLCFGR_R_2 | RCC_PLLCFGR_PLLREN;
    RCC->CR |= RCC_CR_PLLON;
    /* Unbounded on purpose here and below: without its clock the board is dead, and it says so by silence. */
    while ((RCC->CR & RCC_CR_PLLRDY) == 0u) {
    }
    /* The wait states must be in force before the clock rises. */
    FLASH->ACR = (FLASH->ACR & ~FLASH_ACR_LATENCY_Msk) | FLASH_ACR_LATENCY_4 | FLASH_ACR_PRFTEN |
                 FLASH_ACR_ICEN | FLASH_ACR_DCEN;
    while ((FLASH->ACR & FLASH_ACR_LATENCY_Msk) != FLASH_ACR_LATENCY_4) {
    }
    RCC->CFGR = RCC_CFGR_HPRE_2;
    RCC->CFGR = RCC_CFGR_HPRE_2 | RCC_CFGR_SW_PLL;
    while ((RCC->CFGR & RCC_CFGR_SWS_Msk) != RCC_CFGR_SWS_PLL) {
    }
    wait_a_microsecond();
    RCC->CFGR = RCC_CFGR_SW_PLL;
    if (external) {
        /* A clock that dies later raises the NMI instead of silently slowing the time down. */
        RCC->CR |= RCC_CR_CSSON;
    }
    return external;
}

void clock_start_ports(void) {
    clock_enable(&RCC->AHB2ENR, RCC_AHB2ENR_GPIOA | RCC_AHB2ENR_GPIOB | RCC_AHB2ENR_GPIOC);
}

/* Two things come here: the crystal has stopped, or 64 bits of flash were read whose write a power cut had
 * torn. The latter were read by a checksum, which will not hold: the log and the slots expect such places. */
void nmi_handler(void) {
    if ((RCC->CIFR & RCC_CIFR_CSSF) != 0u) {
        RCC->CICR = RCC_CICR_CSSC;
        fault_stop(FAULT_CLOCK_LOST);
    }
    if ((FLASH->ECCR & (FLASH_ECCR_ECCD | FLASH_ECCR_ECCD2)) == 0u) {
        fault_stop(FAULT_UNEXPECTED_INTERRUPT);
    }
    FLASH->ECCR |= FLASH_ECCR_ECCD | FLASH_ECCR_ECCD2; /* by writing 1 */
}
