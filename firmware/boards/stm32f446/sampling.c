#include "sampling.h"

#include "adxl355.h"
#include "board.h"
#include "clock.h"
#include "fault.h"
#include "interrupts.h"
#include "pin.h"
#include "registers.h"
#include "timebase.h"

enum { AF_TIM3 = 2 };

#define CONVERSIONS    (2u * IMPID_OVERSAMPLING) /* two halves */
#define ENCODER_FILTER 3u /* eight equal readings at 90 MHz: pulses below 89 ns are ignored */
/* An overdue half is overwritten from its first conversion on: 125 us after the next tick's instant, less
 * what the tick itself takes. */
#define READABLE_US (BOARD_DIGITAL ? 0u : 50u)
/* The reference is read so often, and takes 22 us of the 125 us to the next trigger. */
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
static volatile sampling_latest_t latest;
/* Where the bench test wants its edge: written by the main loop, followed by the interrupt. */
static volatile uint32_t edge_clock = SAMPLING_TRIGGER_CLOCKS;

/* --- Supply -------------------------------------------------------------------------------------- */

enum { CALIBRATED_AT_MV = 3300, READINGS = 8 };

static void set_supply(uint32_t sum) {
    uint32_t calibrated = *VREFINT_CAL;
    supply_mV = sum == 0u ? 0u : (uint16_t)((CALIBRATED_AT_MV * READINGS * calibrated + sum / 2u) / sum);
}

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

void sampling_measure_supply(void) {
    clock_enable(&RCC->APB2ENR, RCC_APB2ENR_ADC1 | RCC_APB2ENR_ADC2);
    ADC_COMMON->CCR = ADC_CCR_PCLK2_BY_4 | ADC_CCR_TSVREFE;
    ADC1->SMPR1 = ADC_SMP_480_CYCLES << (3u * (ADC_VREFINT_CHANNEL - 10u));
    ADC1->SQR3 = ADC_VREFINT_CHANNEL;
    ADC1->CR2 = ADC_CR2_ADON;
    uint32_t sum = 0;
    /* The first readings fall into the 10 us that the reference needs to start. */
    for (uint32_t i = 0; i < 2u * READINGS; i++) {
        uint32_t code = convert_once();
        sum += i < READINGS ? 0u : code;
    }
    ADC1->CR2 = 0u;
    set_supply(sum);
}

/* Interrupt, at the end of a tick: the reading begun at the one before, and the next begun. `since_us`: since
 * the trigger that ended the tick; too late a start would delay the next trigger's conversion. */
static void follow_supply(uint32_t since_us) {
    static uint32_t sum;
    static uint32_t readings;
    if ((ADC1->SR & ADC_SR_JEOC) != 0u) {
        ADC1->SR = ~ADC_SR_JEOC; /* cleared by writing 0, the others are left alone by writing 1 */
        uint32_t code = ADC1->JDR[0];
        impid_core_reference(core, (uint16_t)code);
        sum += code;
        readings++;
    }
    if (readings == READINGS) {
        set_supply(sum);
        sum = 0u;
        readings = 0u;
    }
    bool wanted = ticks % SUPPLY_TICKS == 0u || impid_core_wants_reference(core);
    if (wanted && since_us < SUPPLY_START_US) {
        ADC1->CR2 |= ADC_CR2_JSWSTART;
    }
}

/* --- Start --------------------------------------------------------------------------------------- */

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

static void start_encoder(tim_regs_t *timer, uint32_t trigger_input) {
    timer->ARR = UINT32_MAX;
    timer->CCMR1 = TIM_CCMR1_CC1S_TI1 | TIM_CCMR1_IC1F(ENCODER_FILTER) | TIM_CCMR1_CC2S_TI2 |
                   TIM_CCMR1_IC2F(ENCODER_FILTER);
    /* Channel 3 captures at the trigger input. The counter does not: in encoder mode it obeys the two
     * inputs alone (RM0390 17.3.12 names this use of a third channel). */
    timer->CCMR2 = TIM_CCMR2_CC3S_TRC;
    timer->SMCR = TIM_SMCR_TS_ITR(trigger_input) | TIM_SMCR_SMS_ENCODER;
    timer->CCER = TIM_CCER_CC3E;
    timer->DIER = TIM_DIER_CC3DE;
    timer->CR1 = TIM_CR1_CEN;
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

void sampling_start(impid_core_t *the_core) {
    core = the_core;
    due_us = IMPID_PERIOD_US;
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMA2);
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_TIM2 | RCC_APB1ENR_TIM3 | RCC_APB1ENR_TIM4 | RCC_APB1ENR_TIM5 |
                                    RCC_APB1ENR_TIM12);

    start_stream(&DMA2->S[0], 0u, &ADC_COMMON->CDR, conversions, DMA_CR_HTIE | DMA_CR_TCIE | DMA_CR_TEIE);
    start_stream(&DMA1->S[1], 3u, &TIM2->CCR3, latched[0], 0u);
    start_stream(&DMA1->S[0], 6u, &TIM5->CCR3, latched[1], 0u);
    start_converters();
    start_encoder(TIM2, 2u); /* ITR2 of TIM2 is TIM3 */
    start_encoder(TIM5, 1u); /* ITR1 of TIM5 is TIM3 */

    TIM3->ARR = SAMPLING_TRIGGER_CLOCKS - 1u;
    TIM3->CR2 = TIM_CR2_MMS_UPDATE;
    TIM3->SMCR = TIM_SMCR_TS_ITR(3) | TIM_SMCR_SMS_TRIGGER; /* ITR3 = TIM4 */

    interrupt_enable(IRQ_ADC, PRIORITY_TICK);
    interrupt_enable(IRQ_DMA2_STREAM0, PRIORITY_TICK);
    timebase_start();
}

/* --- Tick ---------------------------------------------------------------------------------------- */

/* The three streams count the same triggers, the encoders' being at most a trigger ahead of the conversion
 * under way. If they ever differ by more, counts and conversions no longer belong together. */
static bool latch_in_step(void) {
    uint32_t left = DMA2->S[0].NDTR;
    uint32_t ahead_1 = (left - DMA1->S[1].NDTR) % CONVERSIONS;
    uint32_t ahead_2 = (left - DMA1->S[0].NDTR) % CONVERSIONS;
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

/* The readings of a digital sensor that belong to the instant that is due; false: it holds later ones by now.
 */
static bool read_sensor(uint32_t reading[IMPID_AXES_MAX]) {
    if (BOARD_DIGITAL) {
        adxl355_read(reading);
        return timebase_now_us() - due_us < ADXL355_READABLE_US;
    }
    return true;
}

static void serve_due(uint8_t lateness) {
    uint32_t reading[IMPID_AXES_MAX] = {0};
    if (!read_sensor(reading)) {
        impid_core_missed(core, 1u);
        return;
    }
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
        .wide = reading,
        .encoder = {latched[0][last], latched[1][last]},
        .t_us = due_us,
        .flags = flags,
    };
    impid_core_tick(core, &tick);
    latest.encoder[0] = tick.encoder[0];
    latest.encoder[1] = tick.encoder[1];
    latest.codes = (uint32_t)conversions[last][0] | ((uint32_t)conversions[last][1] << 16);
}

/* In the first half of a period, so that the next toggle is the first of this tick's eight, or of its seven
 * behind which the eighth comes just after the instant. */
static void follow_edge(void) {
    static uint32_t followed = SAMPLING_TRIGGER_CLOCKS;
    uint32_t clock = edge_clock;
    if (clock != followed) {
        followed = clock;
        TIM3->CCMR1 = TIM_CCMR1_OC1M_FORCE_LOW;
        TIM3->CCR1 = clock;
        TIM3->CCMR1 = clock < SAMPLING_TRIGGER_CLOCKS ? TIM_CCMR1_OC1M_TOGGLE : TIM_CCMR1_OC1M_FORCE_LOW;
    }
}

static void pass_due(uint32_t periods) {
    due_us += periods * IMPID_PERIOD_US;
    half = (half + periods) % 2u;
}

void dma2_stream0_handler(void) {
    uint32_t entered_us = timebase_now_us();
    uint32_t flags = DMA2->LISR;
    DMA2->LIFCR = DMA_STREAM0_FLAGS;
    if ((flags & DMA_STREAM0_TEIF) != 0u || (DMA1->LISR & DMA1_LOW_TEIFS) != 0u ||
        (DMA1->HISR & DMA1_HIGH_TEIFS) != 0u) {
        fault_stop(FAULT_DMA);
    }
    uint32_t behind_us = entered_us - due_us;
    if (behind_us > UINT32_MAX / 2u) {
        /* Nothing is due: a run a period late, begun between the trigger and the end of its conversion, has
         * served this half already. In time, the interrupt comes 1.3 us after the instant. */
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
    follow_edge();
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

const volatile sampling_latest_t *sampling_latest(void) {
    return &latest;
}

bool sampling_edge(uint32_t clock) {
    if (clock == SAMPLING_TRIGGER_CLOCKS) {
        pin_input(BOARD_EDGE, PIN_PULL_NONE);
    } else if (clock < SAMPLING_EDGE_EARLY ||
               (clock > SAMPLING_EDGE_LATE && clock < SAMPLING_TRIGGER_CLOCKS)) {
        TIM3->CCER = TIM_CCER_CC1E;
        pin_alternate(BOARD_EDGE, AF_TIM3, PIN_PULL_NONE);
    } else {
        return false;
    }
    edge_clock = clock;
    return true;
}

void sampling_health(impid_port_health_t *health) {
    health->supply_mV = supply_mV;
    health->worst_tick_us = worst_us;
    health->sync_us = sync_us;
    health->sync_count = sync_count;
}
