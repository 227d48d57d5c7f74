#include "sampling.h"

#include "board.h"
#include "clock.h"
#include "fault.h"
#include "interrupts.h"
#include "pin.h"
#include "registers.h"
#include "timebase.h"

#define CONVERSIONS    (2u * IMPID_OVERSAMPLING) /* two halves */
#define TRIGGER_HZ     (IMPID_SAMPLE_RATE_HZ * IMPID_OVERSAMPLING)
#define ENCODER_FILTER 3u /* eight equal readings at 144 MHz: pulses below 56 ns are ignored */
/* An overdue half is overwritten from its first conversion on: 125 us after the next tick's instant, less
 * what the tick itself takes. */
#define READABLE_US 50u
/* Channels of DMA1 and of its multiplexer, counted from 0, and the requests that they serve. */
#define CONVERTERS      0u
#define ENCODER_1       1u
#define ENCODER_2       2u
#define REQUEST_ADC1    5u
#define REQUEST_TIM2_C3 58u
#define REQUEST_TIM5_C3 74u
/* The reference is read so often, and takes 7 us of the 125 us to the next trigger. */
#define SUPPLY_TICKS    128u
#define SUPPLY_START_US 60u

/* Written by DMA. The word that both converters make of one trigger has x in its low half: x comes first. */
static volatile uint16_t conversions[CONVERSIONS][2] __attribute__((aligned(4)));
static volatile uint32_t latched[2][CONVERSIONS];

static impid_core_t *core;
/* Of the interrupt alone. */
static uint32_t half;
static uint32_t due_us; /* the instant of the tick that fills `half` */
static bool edge_pending;
/* Written by the interrupt, read by the main loop; single words. */
static volatile uint32_t ticks;
static volatile uint16_t worst_us;
static volatile uint16_t supply_mV;
static volatile uint32_t sync_us;
static volatile uint32_t sync_count;

/* --- Supply -------------------------------------------------------------------------------------- */

enum { CALIBRATED_AT_MV = 3000, READINGS = 8 };

static void set_supply(uint32_t sum) {
    uint32_t calibrated = *VREFINT_CAL;
    supply_mV = sum == 0u ? 0u : (uint16_t)((CALIBRATED_AT_MV * READINGS * calibrated + sum / 2u) / sum);
}

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

void sampling_measure_supply(void) {
    clock_enable(&RCC->AHB2ENR, RCC_AHB2ENR_ADC12);
    ADC_COMMON->CCR = ADC_CCR_HCLK_BY_4 | ADC_CCR_VREFEN;
    start_converter(ADC1);
    ADC1->SMPR2 = ADC_SMP_247_CYCLES << (3u * (ADC_VREFINT_CHANNEL - 10u));
    ADC1->SQR1 = ADC_SQR1_ONE(ADC_VREFINT_CHANNEL);
    ADC1->CFGR = ADC_CFGR_JQDIS;
    uint32_t sum = 0;
    /* The first readings fall into the 12 us that the reference needs to start. */
    for (uint32_t i = 0; i < 2u * READINGS; i++) {
        uint32_t code = convert_once();
        sum += i < READINGS ? 0u : code;
    }
    stop_converter(ADC1);
    set_supply(sum);
}

/* Interrupt, at the end of a tick: the reading begun at the one before, and the next begun. `since_us`: since
 * the trigger that ended the tick; too late a start would delay the next trigger's conversion. */
static void follow_supply(uint32_t since_us) {
    static uint32_t sum;
    static uint32_t readings;
    if ((ADC1->ISR & ADC_ISR_JEOC) != 0u) {
        ADC1->ISR = ADC_ISR_JEOC; /* by writing 1 */
        sum += ADC1->JDR[0];
        readings++;
    }
    if (readings == READINGS) {
        set_supply(sum);
        sum = 0u;
        readings = 0u;
    }
    if (ticks % SUPPLY_TICKS == 0u && since_us < SUPPLY_START_US) {
        /* The bits that read as 1 are set by 1 again; those that end something are 0. */
        ADC1->CR |= ADC_CR_JADSTART;
    }
}

/* --- Start --------------------------------------------------------------------------------------- */

static void start_channel(uint32_t channel, uint32_t request, volatile const void *from,
                          volatile const void *to, uint32_t interrupts) {
    DMAMUX1->CCR[channel] = request;
    DMA1->CH[channel].PAR = (uint32_t)(uintptr_t)from;
    DMA1->CH[channel].MAR = (uint32_t)(uintptr_t)to;
    DMA1->CH[channel].NDTR = CONVERSIONS;
    DMA1->CH[channel].CR = DMA_CR_VERY_HIGH | DMA_CR_WORDS | DMA_CR_MINC | DMA_CR_CIRC | interrupts;
    DMA1->CH[channel].CR |= DMA_CR_EN;
}

static void start_encoder(tim_regs_t *timer, uint32_t trigger_input) {
    timer->ARR = UINT32_MAX;
    timer->CCMR1 = TIM_CCMR1_CC1S_TI1 | TIM_CCMR1_IC1F(ENCODER_FILTER) | TIM_CCMR1_CC2S_TI2 |
                   TIM_CCMR1_IC2F(ENCODER_FILTER);
    /* Channel 3 captures at the trigger input. The counter does not: in encoder mode it obeys the two
     * inputs alone (as on the other board). */
    timer->CCMR2 = TIM_CCMR2_CC3S_TRC;
    timer->SMCR = TIM_SMCR_TS_ITR(trigger_input) | TIM_SMCR_SMS_ENCODER;
    timer->CCER = TIM_CCER_CC3E;
    timer->DIER = TIM_DIER_CC3DE;
    timer->CR1 = TIM_CR1_CEN;
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

void sampling_start(impid_core_t *the_core) {
    core = the_core;
    due_us = IMPID_PERIOD_US;
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX1);
    clock_enable(&RCC->APB1ENR1,
                 RCC_APB1ENR1_TIM2 | RCC_APB1ENR1_TIM3 | RCC_APB1ENR1_TIM4 | RCC_APB1ENR1_TIM5);
    clock_enable(&RCC->APB2ENR, RCC_APB2ENR_TIM15);

    start_channel(CONVERTERS, REQUEST_ADC1, &ADC_COMMON->CDR, conversions,
                  DMA_CR_HTIE | DMA_CR_TCIE | DMA_CR_TEIE);
    start_channel(ENCODER_1, REQUEST_TIM2_C3, &TIM2->CCR3, latched[0], 0u);
    start_channel(ENCODER_2, REQUEST_TIM5_C3, &TIM5->CCR3, latched[1], 0u);
    start_converters();
    start_encoder(TIM2, 2u); /* ITR2 is TIM3, for every timer of this chip */
    start_encoder(TIM5, 2u);

    TIM3->ARR = CLOCK_TIMER_HZ / TRIGGER_HZ - 1u;
    TIM3->CR2 = TIM_CR2_MMS_UPDATE;
    TIM3->SMCR = TIM_SMCR_TS_ITR(3) | TIM_SMCR_SMS_TRIGGER; /* ITR3 = TIM4 */

    interrupt_enable(IRQ_ADC1_2, PRIORITY_TICK);
    interrupt_enable(IRQ_DMA1_CHANNEL1, PRIORITY_TICK);
    timebase_start();
}

/* --- Tick ---------------------------------------------------------------------------------------- */

/* The three channels count the same triggers, the encoders' being at most a trigger ahead of the conversion
 * under way. If they ever differ by more, counts and conversions no longer belong together. */
static bool latch_in_step(void) {
    uint32_t left = DMA1->CH[CONVERTERS].NDTR;
    uint32_t ahead_1 = (left - DMA1->CH[ENCODER_1].NDTR) % CONVERSIONS;
    uint32_t ahead_2 = (left - DMA1->CH[ENCODER_2].NDTR) % CONVERSIONS;
    return ahead_1 <= 1u && ahead_2 <= 1u;
}

/* The edge captured last may be younger than the instant served: then it belongs to the next tick, which is
 * certain to come after it. */
static bool sync_edge_until(uint32_t t_us) {
    bool seen = edge_pending;
    edge_pending = false;
    uint32_t edge_us;
    if (timebase_sync_edge(&edge_us)) {
        sync_us = edge_us;
        bool younger = edge_us - t_us - 1u < UINT32_MAX / 2u;
        seen = seen || !younger;
        edge_pending = younger;
    }
    return seen;
}

static void serve_due(uint8_t lateness) {
    uint8_t flags = lateness;
    uint32_t first = half * IMPID_OVERSAMPLING;
    uint32_t last = first + IMPID_OVERSAMPLING - 1u;
    if (!pin_read(BOARD_ENCODER_1_FAULT) || !pin_read(BOARD_ENCODER_2_FAULT) || !latch_in_step()) {
        flags |= IMPID_FLAG_ENCODER_FAULT;
    }
    if (sync_edge_until(due_us)) {
        sync_count++;
        flags |= IMPID_FLAG_SYNC_EDGE;
    }
    impid_tick_t tick = {
        /* No longer volatile for the core: DMA does not come back to this half before 1125 us have passed. */
        .adc = (const uint16_t *)(uintptr_t)&conversions[first][0],
        .encoder = {latched[0][last], latched[1][last]},
        .t_us = due_us,
        .flags = flags,
    };
    impid_core_tick(core, &tick);
}

static void pass_due(uint32_t periods) {
    due_us += periods * IMPID_PERIOD_US;
    half = (half + periods) % 2u;
}

void dma1_channel1_handler(void) {
    uint32_t entered_us = timebase_now_us();
    uint32_t flags = DMA1->ISR;
    DMA1->IFCR = DMA_IFCR_ALL(CONVERTERS);
    if ((flags & (DMA_ISR_TEIF(0u) | DMA_ISR_TEIF(1u) | DMA_ISR_TEIF(2u) | DMA_ISR_TEIF(3u) |
                  DMA_ISR_TEIF(4u))) != 0u) {
        fault_stop(FAULT_DMA);
    }
    uint32_t behind_us = entered_us - due_us;
    if (behind_us > UINT32_MAX / 2u) {
        /* Nothing is due: a run a period late, begun between the trigger and the end of its conversion, has
         * served this half already. In time, the interrupt comes 11 us after the instant. */
        return;
    }
    uint32_t overdue = behind_us / IMPID_PERIOD_US;
    if (overdue == 1u && behind_us < IMPID_PERIOD_US + READABLE_US) {
        serve_due(IMPID_FLAG_LATE);
        pass_due(1u);
    } else if (overdue > 0u) {
        impid_core_missed(core, overdue);
        pass_due(overdue);
    }
    serve_due(0u);
    pass_due(1u);

    ticks++;
    follow_supply(timebase_now_us() - (due_us - IMPID_PERIOD_US));
    uint32_t took_us = timebase_now_us() - entered_us;
    if (took_us > worst_us) {
        worst_us = took_us < UINT16_MAX ? (uint16_t)took_us : UINT16_MAX;
    }
}

/* DMA has not fetched a conversion for 125 us: it is alone on its controller and takes one word per trigger,
 * so this means that it has stopped. */
void adc_handler(void) {
    fault_stop(FAULT_ADC_OVERRUN);
}

uint32_t sampling_ticks(void) {
    return ticks;
}

void sampling_health(impid_port_health_t *health) {
    health->supply_mV = supply_mV;
    health->worst_tick_us = worst_us;
    health->sync_us = sync_us;
    health->sync_count = sync_count;
}
