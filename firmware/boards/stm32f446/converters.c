/* Both converters and both encoder latches of this chip: every instant is set by hardware.
 *
 * TIM3's trigger output starts ADC1 and ADC2 together (regular simultaneous mode) and, through the internal
 * trigger inputs, makes TIM2 and TIM5 copy their encoder counts into a capture register. DMA carries all
 * three into memory.
 *
 * Skew between the encoder latch and the conversion, from the same edge of TIM3's trigger (f = 90 MHz, ADC
 * clock 22.5 MHz, 44.4 ns):
 *   encoder: resynchronisation of an internal trigger and capture      2 to 4 timer clocks    0.02 .. 0.05 us
 *            input filter: 8 readings, and 2 clocks of synchronisation after the edge on the pin
 *                                                                      the count is behind    0.09 .. 0.12 us
 *   ADC:     trigger to start of sampling                              2 to 3 ADC clocks      0.09 .. 0.14 us
 *            sampling, at whose end the voltage is held                15 ADC clocks                  0.67 us
 *   The counts captured are those of -0.10 .. -0.04 us, the voltage is that of +0.76 .. +0.81 us.
 *
 * So the skew is 0.80 .. 0.91 us, below 1 us, and constant to 0.11 us. Both axes share the ADC clock: their
 * skew is that of two sampling switches, nanoseconds.
 *
 * 15 clocks of sampling suffice: behind the 10 nF filter capacitor the sampling capacitor (7 pF at most)
 * settles through the converter's own 6 kOhm with 42 ns, 16 time constants in 667 ns, and takes 0.07 % of the
 * difference between two consecutive readings of the same axis from the filter capacitor.
 *
 * The supply is measured meanwhile: eight times a second, just behind a tick, ADC1 converts the internal
 * reference once as an injected conversion (ADC2, simultaneous, its own channel: unused), which is over 22 us
 * later, long before the next trigger. It leaves the sampling capacitor of x at 1.2 V: the 0.07 % above of
 * half a volt, in one of eight conversions of that sample, is 0.04 mV, less than one code of 65536 against a
 * noise of 50.
 */
#include "converters.h"

#include "board.h"
#include "clock.h"
#include "interrupts.h"
#include "registers.h"

static uint32_t convert_once(void) {
    ADC1->SR = 0u;
    ADC1->CR2 |= ADC_CR2_SWSTART;
    /* Bounded: a conversion takes 492 ADC clocks, 22 us. */
    for (uint32_t i = 0; i < 10000u; i++) {
        if ((ADC1->SR & ADC_SR_EOC) != 0u) {
            return ADC1->DR;
        }
    }
    return 0u;
}

uint32_t converters_reference(uint32_t readings) {
    clock_enable(&RCC->APB2ENR, RCC_APB2ENR_ADC1 | RCC_APB2ENR_ADC2);
    ADC_COMMON->CCR = ADC_CCR_PCLK2_BY_4 | ADC_CCR_TSVREFE;
    ADC1->SMPR1 = ADC_SMP_480_CYCLES << (3u * (ADC_VREFINT_CHANNEL - 10u));
    ADC1->SQR3 = ADC_VREFINT_CHANNEL;
    ADC1->CR2 = ADC_CR2_ADON;
    uint32_t sum = 0;
    /* The first readings fall into the 10 us that the reference needs to start. */
    for (uint32_t i = 0; i < 2u * readings; i++) {
        uint32_t code = convert_once();
        sum += i < readings ? 0u : code;
    }
    ADC1->CR2 = 0u;
    return sum;
}

bool converters_reference_taken(uint32_t *code) {
    if ((ADC1->SR & ADC_SR_JEOC) == 0u) {
        return false;
    }
    ADC1->SR = ~ADC_SR_JEOC; /* cleared by writing 0, the others are left alone by writing 1 */
    *code = ADC1->JDR[0];
    return true;
}

void converters_take_reference(void) {
    ADC1->CR2 |= ADC_CR2_JSWSTART;
}

static void start_stream(dma_stream_regs_t *stream, uint32_t channel, volatile const void *from,
                         volatile const void *to, uint32_t interrupts) {
    stream->PAR = (uint32_t)(uintptr_t)from;
    stream->M0AR = (uint32_t)(uintptr_t)to;
    stream->NDTR = CONVERSIONS;
    stream->FCR = 0u;
    stream->CR =
        DMA_CR_CHANNEL(channel) | DMA_CR_VERY_HIGH | DMA_CR_WORDS | DMA_CR_MINC | DMA_CR_CIRC | interrupts;
    stream->CR |= DMA_CR_EN;
}

static void start_converters(void) {
    ADC1->SMPR1 = (ADC_SMP_15_CYCLES << (3u * (BOARD_ADC_X_CHANNEL - 10u))) |
                  (ADC_SMP_480_CYCLES << (3u * (ADC_VREFINT_CHANNEL - 10u)));
    ADC2->SMPR1 = ADC_SMP_15_CYCLES << (3u * (BOARD_ADC_Y_CHANNEL - 10u));
    ADC1->JSQR = ADC_JSQR_ONE(ADC_VREFINT_CHANNEL);
    ADC2->JSQR = ADC_JSQR_ONE(BOARD_ADC_Y_CHANNEL);
    ADC1->SQR3 = BOARD_ADC_X_CHANNEL;
    ADC2->SQR3 = BOARD_ADC_Y_CHANNEL;
    ADC1->SR = 0u;
    ADC1->CR1 = ADC_CR1_OVRIE;
    /* The slave first: from the moment the master is on, a trigger would start both. */
    ADC_COMMON->CCR = ADC_CCR_PCLK2_BY_4 | ADC_CCR_DUAL | ADC_CCR_DMA_MODE_2 | ADC_CCR_DDS | ADC_CCR_TSVREFE;
    ADC2->CR2 = ADC_CR2_ADON;
    ADC1->CR2 = ADC_CR2_EXTEN_RISING | ADC_CR2_EXTSEL_TIM3 | ADC_CR2_ADON;
    /* Their 3 us to wake up are over long before the first trigger, 125 us after the start. */
}

void converters_start(conversions_t *to) {
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMA2);
    start_stream(&DMA2->S[0], 0u, &ADC_COMMON->CDR, to->codes, DMA_CR_HTIE | DMA_CR_TCIE | DMA_CR_TEIE);
    start_stream(&DMA1->S[1], 3u, &TIM2->CCR3, to->latched[0], 0u);
    start_stream(&DMA1->S[0], 6u, &TIM5->CCR3, to->latched[1], 0u);
    start_converters();
    interrupt_enable(IRQ_ADC, PRIORITY_TICK);
    interrupt_enable(IRQ_DMA2_STREAM0, PRIORITY_TICK);
}

bool converters_well(void) {
    uint32_t flags = DMA2->LISR;
    DMA2->LIFCR = DMA_STREAM0_FLAGS;
    return (flags & DMA_STREAM0_TEIF) == 0u && (DMA1->LISR & DMA1_LOW_TEIFS) == 0u &&
           (DMA1->HISR & DMA1_HIGH_TEIFS) == 0u;
}

bool converters_in_step(void) {
    uint32_t left = DMA2->S[0].NDTR;
    uint32_t ahead_1 = (left - DMA1->S[1].NDTR) % CONVERSIONS;
    uint32_t ahead_2 = (left - DMA1->S[0].NDTR) % CONVERSIONS;
    return ahead_1 <= 1u && ahead_2 <= 1u;
}
