/* Both converters and both encoder latches of this chip: every instant is set by hardware.
 *
 * TIM3's trigger output starts ADC1 and ADC2 together, each of which converts its channel 16 times in a row
 * and adds the results up, and makes TIM2 and TIM5 copy their encoder counts. DMA carries all three into
 * memory.
 *
 * Skew between the encoder latch and the reading, from the same edge (timers 144 MHz, ADC clock 36 MHz):
 *   encoder: as on the F446, at 144 MHz                    the counts are those of -0.06 .. -0.02 us
 *   ADC:     trigger to start of sampling                  2 to 3 ADC clocks        0.06 .. 0.08 us
 *            25 clocks a conversion, the first 12.5 of which are sampling, at whose end the voltage is held:
 *            the n-th at (25 n + 12.5) / 36 us, their mean                          5.56 us
 *   The voltage is that of 5.64 us after the counts, constant to 0.06 us.
 *
 * The sensor's descriptor takes it off the group delay (impid_adxl203_oversampled): of 2006 us 2000 remain.
 *
 * 12.5 clocks of sampling are 347 ns: behind the 10 nF filter capacitor the sampling capacitor (5 pF) settles
 * within them through the converter's own resistance many times over, and 16 conversions take 0.8 % of the
 * difference between two readings of the same axis from the filter capacitor, as the sum of what each takes.
 *
 * The supply is measured meanwhile: eight times a second, just behind a tick, ADC1 converts the internal
 * reference once as an injected conversion, 7 us, which is not oversampled.
 */
#include "converters.h"

#include "board.h"
#include "clock.h"
#include "interrupts.h"
#include "registers.h"

/* Channels of DMA1 and of its multiplexer, counted from 0, and the requests that they serve. */
#define CONVERTERS      0u
#define ENCODER_1       1u
#define ENCODER_2       2u
#define REQUEST_ADC1    5u
#define REQUEST_TIM2_C3 58u
#define REQUEST_TIM5_C3 74u

/* Turns of at least 3 cycles: 20 us for the converter's regulator to start, at 144 MHz. */
#define REGULATOR_TURNS 1000u
#define ATTEMPTS        100000u

static void wait_while(const reg_t *reg, uint32_t bits, uint32_t value) {
    /* Bounded: a converter that does not answer gives no conversions, which the watchdog notices. */
    for (uint32_t i = 0; i < ATTEMPTS && (*reg & bits) == value; i++) {
    }
}

/* Out of deep power down, calibrated and on. */
static void start_converter(adc_regs_t *adc) {
    adc->CR = ADC_CR_ADVREGEN;
    for (uint32_t i = 0; i < REGULATOR_TURNS; i++) {
        __asm volatile("nop");
    }
    adc->CR = ADC_CR_ADVREGEN | ADC_CR_ADCAL;
    wait_while(&adc->CR, ADC_CR_ADCAL, ADC_CR_ADCAL);
    adc->ISR = ADC_ISR_ADRDY; /* by writing 1 */
    adc->CR = ADC_CR_ADVREGEN | ADC_CR_ADEN;
    wait_while(&adc->ISR, ADC_ISR_ADRDY, 0u);
}

static void stop_converter(adc_regs_t *adc) {
    adc->CR = ADC_CR_ADVREGEN | ADC_CR_ADDIS;
    wait_while(&adc->CR, ADC_CR_ADEN, ADC_CR_ADEN);
}

static uint32_t convert_once(void) {
    ADC1->CR = ADC_CR_ADVREGEN | ADC_CR_ADSTART;
    wait_while(&ADC1->ISR, ADC_ISR_EOC, 0u);
    return ADC1->DR; /* clears EOC */
}

uint32_t converters_reference(uint32_t readings) {
    clock_enable(&RCC->AHB2ENR, RCC_AHB2ENR_ADC12);
    ADC_COMMON->CCR = ADC_CCR_HCLK_BY_4 | ADC_CCR_VREFEN;
    start_converter(ADC1);
    ADC1->SMPR2 = ADC_SMP_247_CYCLES << (3u * (ADC_VREFINT_CHANNEL - 10u));
    ADC1->SQR1 = ADC_SQR1_ONE(ADC_VREFINT_CHANNEL);
    ADC1->CFGR = ADC_CFGR_JQDIS;
    uint32_t sum = 0;
    /* The first readings fall into the 12 us that the reference needs to start. */
    for (uint32_t i = 0; i < 2u * readings; i++) {
        uint32_t code = convert_once();
        sum += i < readings ? 0u : code;
    }
    stop_converter(ADC1);
    return sum;
}

bool converters_reference_taken(uint32_t *code) {
    if ((ADC1->ISR & ADC_ISR_JEOC) == 0u) {
        return false;
    }
    ADC1->ISR = ADC_ISR_JEOC; /* by writing 1 */
    *code = ADC1->JDR[0];
    return true;
}

void converters_take_reference(void) {
    /* The bits that read as 1 are set by 1 again; those that end something are 0. */
    ADC1->CR |= ADC_CR_JADSTART;
}

static void start_channel(uint32_t channel, uint32_t request, volatile const void *from,
                          volatile const void *to, uint32_t interrupts) {
    DMAMUX1->CCR[channel] = request;
    DMA1->CH[channel].PAR = (uint32_t)(uintptr_t)from;
    DMA1->CH[channel].MAR = (uint32_t)(uintptr_t)to;
    DMA1->CH[channel].NDTR = CONVERSIONS;
    DMA1->CH[channel].CR = DMA_CR_VERY_HIGH | DMA_CR_WORDS | DMA_CR_MINC | DMA_CR_CIRC | interrupts;
    DMA1->CH[channel].CR |= DMA_CR_EN;
}

static void start_converters(void) {
    /* Both off: the common register can be written only then. */
    ADC_COMMON->CCR = ADC_CCR_DUAL | ADC_CCR_MDMA_BOTH | ADC_CCR_DMACFG | ADC_CCR_HCLK_BY_4 | ADC_CCR_VREFEN;
    /* The slave first: from the moment the master is on, a trigger would start both. */
    start_converter(ADC2);
    ADC2->SMPR = ADC_SMP_12_CYCLES << (3u * BOARD_ADC_Y_CHANNEL);
    ADC2->SQR1 = ADC_SQR1_ONE(BOARD_ADC_Y_CHANNEL);
    ADC2->CFGR2 = ADC_CFGR2_ROVSE | ADC_CFGR2_OVSR_16;
    ADC2->CFGR = ADC_CFGR_JQDIS;
    start_converter(ADC1);
    ADC1->SMPR = ADC_SMP_12_CYCLES << (3u * BOARD_ADC_X_CHANNEL);
    ADC1->SQR1 = ADC_SQR1_ONE(BOARD_ADC_X_CHANNEL);
    ADC1->JSQR = ADC_JSQR_ONE(ADC_VREFINT_CHANNEL);
    ADC1->CFGR2 = ADC_CFGR2_ROVSE | ADC_CFGR2_OVSR_16;
    ADC1->CFGR = ADC_CFGR_JQDIS | ADC_CFGR_EXTEN_RISING | ADC_CFGR_EXTSEL_TIM3;
    ADC1->IER = ADC_IER_OVRIE;
    ADC1->CR |= ADC_CR_ADSTART; /* from the first trigger on, 125 us after the start of the time */
}

void converters_start(conversions_t *to) {
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX1);
    start_channel(CONVERTERS, REQUEST_ADC1, &ADC_COMMON->CDR, to->codes,
                  DMA_CR_HTIE | DMA_CR_TCIE | DMA_CR_TEIE);
    start_channel(ENCODER_1, REQUEST_TIM2_C3, &TIM2->CCR3, to->latched[0], 0u);
    start_channel(ENCODER_2, REQUEST_TIM5_C3, &TIM5->CCR3, to->latched[1], 0u);
    start_converters();
    interrupt_enable(IRQ_ADC1_2, PRIORITY_TICK);
    interrupt_enable(IRQ_DMA1_CHANNEL1, PRIORITY_TICK);
}

bool converters_well(void) {
    uint32_t flags = DMA1->ISR;
    DMA1->IFCR = DMA_IFCR_ALL(CONVERTERS);
    return (flags & (DMA_ISR_TEIF(0u) | DMA_ISR_TEIF(1u) | DMA_ISR_TEIF(2u) | DMA_ISR_TEIF(3u) |
                     DMA_ISR_TEIF(4u))) == 0u;
}

bool converters_in_step(void) {
    uint32_t left = DMA1->CH[CONVERTERS].NDTR;
    uint32_t ahead_1 = (left - DMA1->CH[ENCODER_1].NDTR) % CONVERSIONS;
    uint32_t ahead_2 = (left - DMA1->CH[ENCODER_2].NDTR) % CONVERSIONS;
    return ahead_1 <= 1u && ahead_2 <= 1u;
}
