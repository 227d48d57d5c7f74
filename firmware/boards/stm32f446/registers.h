/* The registers that this port uses, and no others: addresses, layouts and bits from RM0390 (STM32F446xx
 * reference manual), whose chapter stands beside each, and from the Armv7-M architecture manual for the
 * processor's own. Named as there. Reserved registers only fill the gaps.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

typedef volatile uint32_t reg_t;

/* --- Flash interface (3) ------------------------------------------------------------------------- */
typedef struct {
    reg_t ACR, KEYR, OPTKEYR, SR, CR;
} flash_regs_t;
#define FLASH                 ((flash_regs_t *)0x40023C00u)
#define FLASH_ACR_LATENCY_2   2u
#define FLASH_ACR_LATENCY_Msk 15u
#define FLASH_ACR_PRFTEN      (1u << 8)
#define FLASH_ACR_ICEN        (1u << 9)
#define FLASH_ACR_DCEN        (1u << 10)
#define FLASH_ACR_DCRST       (1u << 12)
#define FLASH_KEY1            0x45670123u
#define FLASH_KEY2            0xCDEF89ABu
#define FLASH_SR_ERRORS       0x000001F2u /* OPERR, WRPERR, PGAERR, PGPERR, PGSERR, RDERR */
#define FLASH_SR_BSY          (1u << 16)
#define FLASH_CR_PG           (1u << 0)
#define FLASH_CR_SER          (1u << 1)
#define FLASH_CR_SNB_Pos      3
#define FLASH_CR_PSIZE_X32    (2u << 8)
#define FLASH_CR_STRT         (1u << 16)
#define FLASH_CR_LOCK         (1u << 31)

/* --- Power controller (5) ------------------------------------------------------------------------ */
typedef struct {
    reg_t CR, CSR;
} pwr_regs_t;
#define PWR            ((pwr_regs_t *)0x40007000u)
#define PWR_CR_VOS_Msk (3u << 14)
#define PWR_CR_VOS_3   (1u << 14)

/* --- Reset and clock control (6) ----------------------------------------------------------------- */
typedef struct {
    reg_t CR, PLLCFGR, CFGR, CIR, AHB1RSTR, AHB2RSTR, AHB3RSTR, reserved1, APB1RSTR, APB2RSTR, reserved2[2];
    reg_t AHB1ENR, AHB2ENR, AHB3ENR, reserved3, APB1ENR, APB2ENR, reserved4[2];
    reg_t AHB1LPENR, AHB2LPENR, AHB3LPENR, reserved5, APB1LPENR, APB2LPENR, reserved6[2];
    reg_t BDCR, CSR;
} rcc_regs_t;
#define RCC                 ((rcc_regs_t *)0x40023800u)
#define RCC_CR_HSEON        (1u << 16)
#define RCC_CR_HSERDY       (1u << 17)
#define RCC_CR_HSEBYP       (1u << 18)
#define RCC_CR_CSSON        (1u << 19)
#define RCC_CR_PLLON        (1u << 24)
#define RCC_CR_PLLRDY       (1u << 25)
#define RCC_PLLCFGR_N_Pos   6
#define RCC_PLLCFGR_P_4     (1u << 16)
#define RCC_PLLCFGR_SRC_HSE (1u << 22)
#define RCC_PLLCFGR_Q_8     (8u << 24) /* unused clock, within its limit */
#define RCC_PLLCFGR_R_2     (2u << 28) /* unused clock, reset value */
#define RCC_CFGR_SW_PLL     2u
#define RCC_CFGR_SWS_Msk    (3u << 2)
#define RCC_CFGR_SWS_PLL    (2u << 2)
#define RCC_CFGR_PPRE1_2    (4u << 10)
#define RCC_CFGR_RTCPRE_Pos 16
#define RCC_CIR_CSSF        (1u << 7)
#define RCC_CIR_CSSC        (1u << 23)
#define RCC_AHB1ENR_GPIOA   (1u << 0)
#define RCC_AHB1ENR_GPIOB   (1u << 1)
#define RCC_AHB1ENR_GPIOC   (1u << 2)
#define RCC_AHB1ENR_DMA1    (1u << 21)
#define RCC_AHB1ENR_DMA2    (1u << 22)
#define RCC_APB1ENR_TIM2    (1u << 0)
#define RCC_APB1ENR_TIM3    (1u << 1)
#define RCC_APB1ENR_TIM4    (1u << 2)
#define RCC_APB1ENR_TIM5    (1u << 3)
#define RCC_APB1ENR_TIM12   (1u << 6)
#define RCC_APB1ENR_SPI2    (1u << 14)
#define RCC_APB1ENR_USART2  (1u << 17)
#define RCC_APB1ENR_CAN1    (1u << 25)
#define RCC_APB1ENR_PWR     (1u << 28)
#define RCC_APB2ENR_TIM1    (1u << 0)
#define RCC_APB2ENR_ADC1    (1u << 8)
#define RCC_APB2ENR_ADC2    (1u << 9)
#define RCC_APB2ENR_TIM11   (1u << 18)
#define RCC_CSR_RMVF        (1u << 24)
#define RCC_CSR_BORRSTF     (1u << 25)
#define RCC_CSR_PINRSTF     (1u << 26)
#define RCC_CSR_PORRSTF     (1u << 27)
#define RCC_CSR_SFTRSTF     (1u << 28)
#define RCC_CSR_IWDGRSTF    (1u << 29)
#define RCC_CSR_WWDGRSTF    (1u << 30)

/* --- General-purpose I/O (7) --------------------------------------------------------------------- */
typedef struct {
    reg_t MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFR[2];
} gpio_regs_t;
#define GPIOA ((gpio_regs_t *)0x40020000u)
#define GPIOB ((gpio_regs_t *)0x40020400u)
#define GPIOC ((gpio_regs_t *)0x40020800u)

/* --- DMA (9) ------------------------------------------------------------------------------------- */
typedef struct {
    reg_t CR, NDTR, PAR, M0AR, M1AR, FCR;
} dma_stream_regs_t;
typedef struct {
    reg_t LISR, HISR, LIFCR, HIFCR;
    dma_stream_regs_t S[8];
} dma_regs_t;
#define DMA1               ((dma_regs_t *)0x40026000u)
#define DMA2               ((dma_regs_t *)0x40026400u)
#define DMA_CR_EN          (1u << 0)
#define DMA_CR_TEIE        (1u << 2)
#define DMA_CR_HTIE        (1u << 3)
#define DMA_CR_TCIE        (1u << 4)
#define DMA_CR_FROM_MEMORY (1u << 6)
#define DMA_CR_CIRC        (1u << 8)
#define DMA_CR_MINC        (1u << 10)
#define DMA_CR_WORDS       ((2u << 11) | (2u << 13)) /* PSIZE, MSIZE */
#define DMA_CR_VERY_HIGH   (3u << 16)
#define DMA_CR_CHANNEL(n)  ((uint32_t)(n) << 25)
#define DMA_STREAM0_FLAGS  0x3Du /* in LISR, LIFCR */
#define DMA_STREAM0_TEIF   (1u << 3)
#define DMA_STREAM6_FLAGS  (0x3Du << 16)            /* in HISR, HIFCR */
#define DMA1_LOW_TEIFS     ((1u << 3) | (1u << 9))  /* streams 0 and 1, in LISR */
#define DMA1_HIGH_TEIFS    ((1u << 9) | (1u << 19)) /* streams 5 and 6, in HISR */

/* --- ADC (13) ------------------------------------------------------------------------------------ */
typedef struct {
    reg_t SR, CR1, CR2, SMPR1, SMPR2, JOFR[4], HTR, LTR, SQR1, SQR2, SQR3, JSQR, JDR[4], DR;
} adc_regs_t;
typedef struct {
    reg_t CSR, CCR, CDR;
} adc_common_regs_t;
#define ADC1                 ((adc_regs_t *)0x40012000u)
#define ADC2                 ((adc_regs_t *)0x40012100u)
#define ADC_COMMON           ((adc_common_regs_t *)0x40012300u)
#define ADC_SR_EOC           (1u << 1)
#define ADC_SR_JEOC          (1u << 2)
#define ADC_SR_OVR           (1u << 5)
#define ADC_CR1_OVRIE        (1u << 26)
#define ADC_CR2_ADON         (1u << 0)
#define ADC_CR2_JSWSTART     (1u << 22)
#define ADC_CR2_EXTSEL_TIM3  (8u << 24) /* TIM3_TRGO */
#define ADC_CR2_EXTEN_RISING (1u << 28)
#define ADC_CR2_SWSTART      (1u << 30)
#define ADC_SMP_15_CYCLES    1u
#define ADC_SMP_480_CYCLES   7u
#define ADC_CCR_DUAL         1u /* MULTI: regular and injected simultaneous mode */
#define ADC_CCR_DDS          (1u << 13)
#define ADC_CCR_DMA_MODE_2   (2u << 14)
#define ADC_CCR_PCLK2_BY_4   (1u << 16)
#define ADC_CCR_TSVREFE      (1u << 23)
#define ADC_JSQR_ONE(n)      ((uint32_t)(n) << 15) /* JL = 0: JSQ4 is the sequence */
#define ADC_VREFINT_CHANNEL  17u

/* --- Timers (17: TIM2 to TIM5; 18: TIM11, TIM12) ------------------------------------------------- */
typedef struct {
    reg_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, reserved1, CCR1, CCR2, CCR3, CCR4;
    reg_t reserved2[3], OR;
} tim_regs_t;
#define TIM2                     ((tim_regs_t *)0x40000000u)
#define TIM3                     ((tim_regs_t *)0x40000400u)
#define TIM4                     ((tim_regs_t *)0x40000800u)
#define TIM5                     ((tim_regs_t *)0x40000C00u)
#define TIM11                    ((tim_regs_t *)0x40014800u)
#define TIM12                    ((tim_regs_t *)0x40001800u)
#define TIM_CR1_CEN              (1u << 0)
#define TIM_CR2_MMS_UPDATE       (2u << 4)
#define TIM_SMCR_SMS_ENCODER     3u /* counts on both edges of TI1 and TI2 */
#define TIM_SMCR_SMS_TRIGGER     6u
#define TIM_SMCR_SMS_EXTERNAL_1  7u
#define TIM_SMCR_TS_ITR(n)       ((uint32_t)(n) << 4)
#define TIM_DIER_CC3DE           (1u << 11)
#define TIM_SR_CC1IF             (1u << 1)
#define TIM_SR_CC1OF             (1u << 9)
#define TIM_EGR_UG               (1u << 0)
#define TIM_CCMR1_CC1S_TI1       (1u << 0)
#define TIM_CCMR1_IC1PSC_8       (3u << 2)
#define TIM_CCMR1_OC1M_TOGGLE    (3u << 4)
#define TIM_CCMR1_OC1M_FORCE_LOW (4u << 4)
#define TIM_CCMR1_IC1F(n)        ((uint32_t)(n) << 4)
#define TIM_CCMR1_CC2S_TI2       (1u << 8)
#define TIM_CCMR1_IC2F(n)        ((uint32_t)(n) << 12)
#define TIM_CCMR2_CC3S_TRC       3u
#define TIM_CCER_CC1E            (1u << 0)
#define TIM_CCER_CC3E            (1u << 8)
#define TIM11_OR_TI1_HSE_RTC     2u

/* --- Advanced timer (16) ------------------------------------------------------------------------- */
typedef struct {
    reg_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, RCR, CCR1, CCR2, CCR3, CCR4, BDTR;
} tim1_regs_t;
#define TIM1                 ((tim1_regs_t *)0x40010000u)
#define TIM1_CCMR1_OC2M_PWM2 (7u << 12)
#define TIM1_CCER_CC2E       (1u << 4)
#define TIM1_BDTR_MOE        (1u << 15)

/* --- SPI (26) ------------------------------------------------------------------------------------ */
typedef struct {
    reg_t CR1, CR2, SR, DR;
} spi_regs_t;
#define SPI2         ((spi_regs_t *)0x40003800u)
#define SPI_CR1_MSTR (1u << 2)
#define SPI_CR1_BR_8 (2u << 3)
#define SPI_CR1_SPE  (1u << 6)
#define SPI_CR1_SSI  (1u << 8)
#define SPI_CR1_SSM  (1u << 9)
#define SPI_SR_RXNE  (1u << 0)

/* --- Independent watchdog (20) ------------------------------------------------------------------- */
typedef struct {
    reg_t KR, PR, RLR, SR;
} iwdg_regs_t;
#define IWDG            ((iwdg_regs_t *)0x40003000u)
#define IWDG_KR_UNLOCK  0x5555u
#define IWDG_KR_REFRESH 0xAAAAu
#define IWDG_KR_START   0xCCCCu
#define IWDG_PR_32      3u

/* --- USART (25) ---------------------------------------------------------------------------------- */
typedef struct {
    reg_t SR, DR, BRR, CR1, CR2, CR3, GTPR;
} usart_regs_t;
#define USART2           ((usart_regs_t *)0x40004400u)
#define USART_SR_ERRORS  0xEu /* FE, NF, ORE */
#define USART_SR_IDLE    (1u << 4)
#define USART_SR_TC      (1u << 6)
#define USART_CR1_RE     (1u << 2)
#define USART_CR1_TE     (1u << 3)
#define USART_CR1_IDLEIE (1u << 4)
#define USART_CR1_UE     (1u << 13)
#define USART_CR3_DMAR   (1u << 6)
#define USART_CR3_DMAT   (1u << 7)

/* --- bxCAN (30) ---------------------------------------------------------------------------------- */
typedef struct {
    reg_t TIR, TDTR, TDLR, TDHR;
} can_tx_regs_t;
typedef struct {
    reg_t RIR, RDTR, RDLR, RDHR;
} can_rx_regs_t;
typedef struct {
    reg_t MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR, reserved1[88];
    can_tx_regs_t TX[3];
    can_rx_regs_t RX[2];
    reg_t reserved2[12];
    reg_t FMR, FM1R, reserved3, FS1R, reserved4, FFA1R, reserved5, FA1R, reserved6[8];
    struct {
        reg_t FR1, FR2;
    } F[28];
} can_regs_t;
#define CAN1             ((can_regs_t *)0x40006400u)
#define CAN_MCR_INRQ     (1u << 0)
#define CAN_MCR_TXFP     (1u << 2)
#define CAN_MCR_ABOM     (1u << 6)
#define CAN_MSR_INAK     (1u << 0)
#define CAN_MSR_ERRI     (1u << 2)
#define CAN_TSR_RQCP     ((1u << 0) | (1u << 8) | (1u << 16))
#define CAN_TSR_TME(n)   (1u << (26u + (n)))
#define CAN_TSR_TME_Msk  (7u << 26)
#define CAN_RF0R_FMP_Msk 3u
#define CAN_RF0R_FOVR    (1u << 4)
#define CAN_RF0R_RFOM    (1u << 5)
#define CAN_IER_TMEIE    (1u << 0)
#define CAN_IER_FMPIE0   (1u << 1)
#define CAN_IER_BOFIE    (1u << 10)
#define CAN_IER_ERRIE    (1u << 15)
#define CAN_ESR_BOFF     (1u << 2)
#define CAN_ESR_TEC_Pos  16
#define CAN_ESR_REC_Pos  24
#define CAN_TIR_TXRQ     (1u << 0)
#define CAN_TIR_STID_Pos 21
#define CAN_RIR_STID_Pos 21
#define CAN_RDTR_DLC_Msk 15u
#define CAN_FMR_FINIT    (1u << 0)
#define CAN_BTR_LBKM     (1u << 30)
#define CAN_BTR_SILM     (1u << 31)

/* --- Device electronic signature (34); VREFINT_CAL: data sheet, embedded reference voltage -------- */
#define UNIQUE_ID   ((const volatile uint32_t *)0x1FFF7A10u)
#define VREFINT_CAL ((const volatile uint16_t *)0x1FFF7A2Au)

/* --- Processor: NVIC and SCB (Armv7-M architecture, B3.2, B3.4) ----------------------------------- */
typedef struct {
    reg_t CPUID, ICSR, VTOR, AIRCR, SCR, CCR, SHPR[3], SHCSR, CFSR, HFSR, DFSR, MMFAR, BFAR;
} scb_regs_t;
#define SCB                 ((scb_regs_t *)0xE000ED00u)
#define SCB_AIRCR_RESET     (0x05FA0000u | (1u << 2)) /* VECTKEY, SYSRESETREQ */
#define SCB_CFSR_MMARVALID  (1u << 7)
#define SCB_CFSR_BFARVALID  (1u << 15)
#define SCB_ICSR_VECTACTIVE 0x1FFu
#define NVIC_ISER           ((reg_t *)0xE000E100u)
#define NVIC_IPR            ((volatile uint8_t *)0xE000E400u)

#endif
