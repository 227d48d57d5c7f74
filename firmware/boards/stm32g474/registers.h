/* The registers that this port uses, and no others: addresses, layouts and bits from RM0440 (STM32G4
 * reference manual), and from the Armv7-M architecture manual for the processor's own. Named as there.
 * Reserved registers only fill the gaps.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

typedef volatile uint32_t reg_t;

/* --- Flash interface ------------------------------------------------------------------------------ */
typedef struct {
    reg_t ACR, PDKEYR, KEYR, OPTKEYR, SR, CR, ECCR, reserved1, OPTR;
} flash_regs_t;
#define FLASH                 ((flash_regs_t *)0x40022000u)
#define FLASH_ACR_LATENCY_4   4u
#define FLASH_ACR_LATENCY_Msk 15u
#define FLASH_ACR_PRFTEN      (1u << 8)
#define FLASH_ACR_ICEN        (1u << 9)
#define FLASH_ACR_DCEN        (1u << 10)
#define FLASH_ACR_DCRST       (1u << 12)
#define FLASH_KEY1            0x45670123u
#define FLASH_KEY2            0xCDEF89ABu
#define FLASH_SR_ERRORS       0x0000C3FAu /* OPERR, PROGERR to FASTERR, RDERR, OPTVERR */
#define FLASH_SR_BSY          (1u << 16)
#define FLASH_CR_PG           (1u << 0)
#define FLASH_CR_PER          (1u << 1)
#define FLASH_CR_PNB_Pos      3
#define FLASH_CR_BKER         (1u << 11)
#define FLASH_CR_STRT         (1u << 16)
#define FLASH_CR_LOCK         (1u << 31)
#define FLASH_ECCR_ECCD       (1u << 31)
#define FLASH_ECCR_ECCD2      (1u << 29)

/* --- Power controller ------------------------------------------------------------------------------ */
typedef struct {
    reg_t CR1, CR2, CR3;
} pwr_regs_t;
#define PWR                 ((pwr_regs_t *)0x40007000u)
#define PWR_CR3_UCPD1_DBDIS (1u << 14)

/* --- Reset and clock control ----------------------------------------------------------------------- */
typedef struct {
    reg_t CR, ICSCR, CFGR, PLLCFGR, reserved1[2], CIER, CIFR, CICR, reserved2;
    reg_t AHB1RSTR, AHB2RSTR, AHB3RSTR, reserved3, APB1RSTR1, APB1RSTR2, APB2RSTR, reserved4;
    reg_t AHB1ENR, AHB2ENR, AHB3ENR, reserved5, APB1ENR1, APB1ENR2, APB2ENR, reserved6[9];
    reg_t CCIPR, reserved7, BDCR, CSR;
} rcc_regs_t;
#define RCC                     ((rcc_regs_t *)0x40021000u)
#define RCC_CR_HSEON            (1u << 16)
#define RCC_CR_HSERDY           (1u << 17)
#define RCC_CR_HSEBYP           (1u << 18)
#define RCC_CR_CSSON            (1u << 19)
#define RCC_CR_PLLON            (1u << 24)
#define RCC_CR_PLLRDY           (1u << 25)
#define RCC_PLLCFGR_SRC_HSI     2u
#define RCC_PLLCFGR_SRC_HSE     3u
#define RCC_PLLCFGR_M_Pos       4 /* less one */
#define RCC_PLLCFGR_N_Pos       8
#define RCC_PLLCFGR_PLLREN      (1u << 24)
#define RCC_PLLCFGR_R_2         (0u << 25)
#define RCC_CFGR_SW_PLL         3u
#define RCC_CFGR_SWS_Msk        (3u << 2)
#define RCC_CFGR_SWS_PLL        (3u << 2)
#define RCC_CFGR_HPRE_2         (8u << 4)
#define RCC_CIFR_CSSF           (1u << 8)
#define RCC_CICR_CSSC           (1u << 8)
#define RCC_AHB1ENR_DMA1        (1u << 0)
#define RCC_AHB1ENR_DMAMUX1     (1u << 2)
#define RCC_AHB2ENR_GPIOA       (1u << 0)
#define RCC_AHB2ENR_GPIOB       (1u << 1)
#define RCC_AHB2ENR_GPIOC       (1u << 2)
#define RCC_AHB2ENR_ADC12       (1u << 13)
#define RCC_APB1ENR1_TIM2       (1u << 0)
#define RCC_APB1ENR1_TIM3       (1u << 1)
#define RCC_APB1ENR1_TIM4       (1u << 2)
#define RCC_APB1ENR1_TIM5       (1u << 3)
#define RCC_APB1ENR1_USART2     (1u << 17)
#define RCC_APB1ENR1_FDCAN      (1u << 25)
#define RCC_APB1ENR1_PWR        (1u << 28)
#define RCC_APB2ENR_TIM15       (1u << 16)
#define RCC_CCIPR_FDCANSEL_PCLK (2u << 24)
#define RCC_CSR_RMVF            (1u << 23)
#define RCC_CSR_PINRSTF         (1u << 26)
#define RCC_CSR_BORRSTF         (1u << 27)
#define RCC_CSR_SFTRSTF         (1u << 28)
#define RCC_CSR_IWDGRSTF        (1u << 29)
#define RCC_CSR_WWDGRSTF        (1u << 30)

/* --- General-purpose I/O --------------------------------------------------------------------------- */
typedef struct {
    reg_t MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFR[2];
} gpio_regs_t;
#define GPIOA ((gpio_regs_t *)0x48000000u)
#define GPIOB ((gpio_regs_t *)0x48000400u)
#define GPIOC ((gpio_regs_t *)0x48000800u)

/* --- DMA and its multiplexer ------------------------------------------------------------------------ */
typedef struct {
    reg_t CR, NDTR, PAR, MAR, reserved1;
} dma_channel_regs_t;
typedef struct {
    reg_t ISR, IFCR;
    dma_channel_regs_t CH[8];
} dma_regs_t;
typedef struct {
    reg_t CCR[16];
} dmamux_regs_t;
#define DMA1               ((dma_regs_t *)0x40020000u)
#define DMAMUX1            ((dmamux_regs_t *)0x40020800u)
#define DMA_CR_EN          (1u << 0)
#define DMA_CR_TCIE        (1u << 1)
#define DMA_CR_HTIE        (1u << 2)
#define DMA_CR_TEIE        (1u << 3)
#define DMA_CR_FROM_MEMORY (1u << 4)
#define DMA_CR_CIRC        (1u << 5)
#define DMA_CR_MINC        (1u << 7)
#define DMA_CR_WORDS       ((2u << 8) | (2u << 10)) /* PSIZE, MSIZE */
#define DMA_CR_VERY_HIGH   (3u << 12)
#define DMA_ISR_TEIF(n)    (8u << (4u * (n)))  /* of channel n + 1 */
#define DMA_IFCR_ALL(n)    (15u << (4u * (n))) /* of channel n + 1 */

/* --- ADC --------------------------------------------------------------------------------------------- */
typedef struct {
    reg_t ISR, IER, CR, CFGR, CFGR2, SMPR, SMPR2, reserved1, TR1, TR2, TR3, reserved2;
    reg_t SQR1, SQR2, SQR3, SQR4, DR, reserved3[2], JSQR, reserved4[4], OFR[4], reserved5[4], JDR[4];
} adc_regs_t;
typedef struct {
    reg_t CSR, reserved1, CCR, CDR;
} adc_common_regs_t;
#define ADC1                  ((adc_regs_t *)0x50000000u)
#define ADC2                  ((adc_regs_t *)0x50000100u)
#define ADC_COMMON            ((adc_common_regs_t *)0x50000300u)
#define ADC_ISR_ADRDY         (1u << 0)
#define ADC_ISR_EOC           (1u << 2)
#define ADC_ISR_JEOC          (1u << 5)
#define ADC_IER_OVRIE         (1u << 4)
#define ADC_CR_ADEN           (1u << 0)
#define ADC_CR_ADDIS          (1u << 1)
#define ADC_CR_ADSTART        (1u << 2)
#define ADC_CR_JADSTART       (1u << 3)
#define ADC_CR_ADVREGEN       (1u << 28)
#define ADC_CR_ADCAL          (1u << 31)
#define ADC_CFGR_EXTSEL_TIM3  (4u << 5) /* TIM3_TRGO */
#define ADC_CFGR_EXTEN_RISING (1u << 10)
#define ADC_CFGR_JQDIS        (1u << 31)
#define ADC_CFGR2_ROVSE       (1u << 0)
#define ADC_CFGR2_OVSR_16     (3u << 2)            /* added up, not shifted */
#define ADC_SMP_12_CYCLES     2u                   /* 12.5 */
#define ADC_SMP_247_CYCLES    6u                   /* 247.5 */
#define ADC_SQR1_ONE(n)       ((uint32_t)(n) << 6) /* L = 0: SQ1 is the sequence */
#define ADC_JSQR_ONE(n)       ((uint32_t)(n) << 9) /* JL = 0: JSQ1 is the sequence */
#define ADC_CCR_DUAL          6u                   /* regular simultaneous mode */
#define ADC_CCR_DMACFG        (1u << 13)           /* circular */
#define ADC_CCR_MDMA_BOTH     (2u << 14)           /* both results in one word, up to 16 bits each */
#define ADC_CCR_HCLK_BY_4     (3u << 16)
#define ADC_CCR_VREFEN        (1u << 22)
#define ADC_VREFINT_CHANNEL   18u

/* --- Timers ------------------------------------------------------------------------------------------ */
typedef struct {
    reg_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, reserved1, CCR1, CCR2, CCR3, CCR4;
} tim_regs_t;
#define TIM2                     ((tim_regs_t *)0x40000000u)
#define TIM3                     ((tim_regs_t *)0x40000400u)
#define TIM4                     ((tim_regs_t *)0x40000800u)
#define TIM5                     ((tim_regs_t *)0x40000C00u)
#define TIM15                    ((tim_regs_t *)0x40014000u)
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
#define TIM_CCMR1_IC1F(n)        ((uint32_t)(n) << 4)
#define TIM_CCMR1_CC2S_TI2       (1u << 8)
#define TIM_CCMR1_IC2F(n)        ((uint32_t)(n) << 12)
#define TIM_CCMR1_OC1M_TOGGLE    (3u << 4)
#define TIM_CCMR1_OC1M_FORCE_LOW (4u << 4)
#define TIM_CCMR2_CC3S_TRC       3u
#define TIM_CCER_CC1E            (1u << 0)
#define TIM_CCER_CC3E            (1u << 8)

/* --- Independent watchdog ---------------------------------------------------------------------------- */
typedef struct {
    reg_t KR, PR, RLR, SR;
} iwdg_regs_t;
#define IWDG            ((iwdg_regs_t *)0x40003000u)
#define IWDG_KR_UNLOCK  0x5555u
#define IWDG_KR_REFRESH 0xAAAAu
#define IWDG_KR_START   0xCCCCu
#define IWDG_PR_32      3u

/* --- USART ------------------------------------------------------------------------------------------- */
typedef struct {
    reg_t CR1, CR2, CR3, BRR, GTPR, RTOR, RQR, ISR, ICR, RDR, TDR, PRESC;
} usart_regs_t;
#define USART2           ((usart_regs_t *)0x40004400u)
#define USART_ISR_ERRORS 0xEu /* FE, NE, ORE; the same in ICR */
#define USART_ISR_IDLE   (1u << 4)
#define USART_ISR_TC     (1u << 6)
#define USART_ICR_IDLE   (1u << 4)
#define USART_ICR_TC     (1u << 6)
#define USART_CR1_UE     (1u << 0)
#define USART_CR1_RE     (1u << 2)
#define USART_CR1_TE     (1u << 3)
#define USART_CR1_IDLEIE (1u << 4)
#define USART_CR3_DMAR   (1u << 6)
#define USART_CR3_DMAT   (1u << 7)

/* --- FDCAN, and the layout of its message memory ------------------------------------------------------ */
typedef struct {
    reg_t CREL, ENDN, reserved1, DBTP, TEST, RWD, CCCR, NBTP, TSCC, TSCV, TOCC, TOCV, reserved2[4];
    reg_t ECR, PSR, TDCR, reserved3, IR, IE, ILS, ILE, reserved4[8], RXGFC, XIDAM, HPMS, reserved5;
    reg_t RXF0S, RXF0A, RXF1S, RXF1A, reserved6[8];
    reg_t TXBC, TXFQS, TXBRP, TXBAR, TXBCR, TXBTO, TXBCF, TXBTIE, TXBCIE;
} fdcan_regs_t;
typedef struct {
    reg_t ID, LENGTH, DATA[16];
} fdcan_element_t;
typedef struct {
    reg_t FILTER[28], EXTENDED_FILTER[16];
    fdcan_element_t RX0[3], RX1[3];
    reg_t TX_EVENT[6];
    fdcan_element_t TX[3];
} fdcan_ram_t;
#define FDCAN1                ((fdcan_regs_t *)0x40006400u)
#define FDCANRAM1             ((fdcan_ram_t *)0x4000A400u)
#define FDCAN_CCCR_INIT       (1u << 0)
#define FDCAN_CCCR_CCE        (1u << 1)
#define FDCAN_NBTP_NTSEG2_Pos 0 /* all four less one */
#define FDCAN_NBTP_NTSEG1_Pos 8
#define FDCAN_NBTP_NBRP_Pos   16
#define FDCAN_NBTP_NSJW_Pos   25
#define FDCAN_ECR_TEC_Pos     0
#define FDCAN_ECR_REC_Pos     8
#define FDCAN_PSR_BO          (1u << 7)
#define FDCAN_IR_RF0N         (1u << 0)
#define FDCAN_IR_RF0L         (1u << 2)
#define FDCAN_IR_TC           (1u << 7)
#define FDCAN_IR_BO           (1u << 19)
#define FDCAN_IE_RF0N         (1u << 0)
#define FDCAN_IE_RF0L         (1u << 2)
#define FDCAN_IE_TC           (1u << 7)
#define FDCAN_IE_BO           (1u << 19)
#define FDCAN_ILS_SMSG        (1u << 2) /* to line 1: transmission, */
#define FDCAN_ILS_PERR        (1u << 6) /* bus-off */
#define FDCAN_ILE_BOTH        3u
#define FDCAN_RXGFC_REJECT    0x0000002Bu /* remote frames, and what no filter takes */
#define FDCAN_RXGFC_LSS_Pos   16
#define FDCAN_RXF0S_F0FL_Msk  15u
#define FDCAN_RXF0S_F0GI_Pos  8
#define FDCAN_TXFQS_TFFL_Msk  7u
#define FDCAN_TXFQS_TFQPI_Pos 16
#define FDCAN_TXFQS_TFQF      (1u << 21)
#define FDCAN_TXBTIE_ALL      7u
#define FDCAN_FILTER_TWO_IDS  ((1u << 30) | (1u << 27)) /* SFT: either of two; SFEC: to FIFO 0 */
#define FDCAN_FILTER_ID1_Pos  16
#define FDCAN_ELEMENT_ID_Pos  18
#define FDCAN_ELEMENT_DLC_Pos 16

/* --- Device electronic signature; VREFINT_CAL: data sheet, embedded voltage reference ------------------ */
#define UNIQUE_ID   ((const volatile uint32_t *)0x1FFF7590u)
#define VREFINT_CAL ((const volatile uint16_t *)0x1FFF75AAu)

/* --- Processor: NVIC and SCB (Armv7-M architecture, B3.2, B3.4) ----------------------------------------- */
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
