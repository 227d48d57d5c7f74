#include "sampling.h"

#include "adxl355.h"
#include "board.h"
#include "converters.h"
#include "fault.h"
#include "interrupts.h"
#include "parts.h"
#include "pin.h"
#include "registers.h"
#include "timebase.h"

enum { AF_TIM3 = 2 };

/* Eight equal readings: at 90 MHz pulses below 89 ns are ignored, at 144 MHz below 56 ns. */
#define ENCODER_FILTER 3u
/* An overdue half is overwritten from its first conversion on: 125 us after the next tick's instant, less
 * what the tick itself takes. */
#define READABLE_US (BOARD_DIGITAL ? 0u : 50u)
/* The reference is read so often, and takes at most 22 us of the 125 us to the next trigger. */
#define SUPPLY_TICKS    128u
#define SUPPLY_START_US 60u

static conversions_t conversions;

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

#define READINGS 8u

static void set_supply(uint32_t sum) {
    uint32_t calibrated = *VREFINT_CAL;
    supply_mV =
        sum == 0u ? 0u : (uint16_t)((REFERENCE_CALIBRATED_AT_MV * READINGS * calibrated + sum / 2u) / sum);
}

void sampling_measure_supply(void) {
    set_supply(converters_reference(READINGS));
}

/* Interrupt, at the end of a tick: the reading begun at the one before, and the next begun. `since_us`: since
 * the trigger that ended the tick; too late a start would delay the next trigger's conversion. */
static void follow_supply(uint32_t since_us) {
    static uint32_t sum;
    static uint32_t readings;
    uint32_t code;
    if (converters_reference_taken(&code)) {
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
        converters_take_reference();
    }
}

/* --- Start --------------------------------------------------------------------------------------- */

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

void sampling_start(impid_core_t *the_core) {
    core = the_core;
    due_us = IMPID_PERIOD_US;
    parts_clock_timers();
    converters_start(&conversions);
    start_encoder(TIM2, ENCODER_1_FROM_TIM3);
    start_encoder(TIM5, ENCODER_2_FROM_TIM3);

    TIM3->ARR = SAMPLING_TRIGGER_CLOCKS - 1u;
    TIM3->CR2 = TIM_CR2_MMS_UPDATE;
    TIM3->SMCR = TIM_SMCR_TS_ITR(TIM3_FROM_TIM4) | TIM_SMCR_SMS_TRIGGER;
    timebase_start();
}

/* --- Tick ---------------------------------------------------------------------------------------- */

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
    if (!pin_read(BOARD_ENCODER_1_FAULT) || !pin_read(BOARD_ENCODER_2_FAULT) || !converters_in_step()) {
        flags |= IMPID_FLAG_ENCODER_FAULT;
    }
    if (sync_edge_until(due_us)) {
        sync_count++;
        flags |= IMPID_FLAG_SYNC_EDGE;
    }
    impid_tick_t tick = {
        /* No longer volatile for the core: DMA does not come back to this half before 1125 us have passed. */
        .adc = (const uint16_t *)(uintptr_t)&conversions.codes[first][0],
        .wide = reading,
        .encoder = {conversions.latched[0][last], conversions.latched[1][last]},
        .t_us = due_us,
        .flags = flags,
    };
    impid_core_tick(core, &tick);
    latest.encoder[0] = tick.encoder[0];
    latest.encoder[1] = tick.encoder[1];
    latest.codes = (uint32_t)conversions.codes[last][0] | ((uint32_t)conversions.codes[last][1] << 16);
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

void tick_handler(void) {
    uint32_t entered_us = timebase_now_us();
    if (!converters_well()) {
        fault_stop(FAULT_DMA);
    }
    uint32_t behind_us = entered_us - due_us;
    if (behind_us > UINT32_MAX / 2u) {
        /* Nothing is due: a run a period late, begun between the trigger and the end of its conversion, has
         * served this half already. In time, the interrupt comes when the conversions begun at the instant
         * are over. */
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
