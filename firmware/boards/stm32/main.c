/* The board: brings the hardware up, gives the core its port, and runs the main loop. For every chip. */
#include "adxl355.h"
#include "bench.h"
#include "board.h"
#include "can.h"
#include "clock.h"
#include "fault.h"
#include "flash.h"
#include "impid_build.h"
#include "impid_messages.h"
#include "inputs.h"
#include "interrupts.h"
#include "pin.h"
#include "registers.h"
#include "sampling.h"
#include "serial.h"
#include "slots.h"
#include "timebase.h"
#include "watchdog.h"

/* As long as a serial line can need for what is queued, twice. */
#define RESET_PATIENCE_TICKS 30u

static impid_core_t core;
static impid_settings_t settings;
static bool reset_requested;

static uint32_t port_now_us(void *context) {
    (void)context;
    return timebase_now_us();
}

static bool port_serial_send(void *context, const uint8_t *bytes, size_t count) {
    (void)context;
    return serial_send(bytes, count);
}

static bool port_can_send(void *context, const impid_can_frame_t *frame) {
    (void)context;
    return can_send(frame);
}

static uint32_t port_backlog_us(void *context, impid_carrier_t carrier) {
    (void)context;
    return carrier == IMPID_CARRIER_SERIAL ? serial_backlog_us() : can_backlog_us();
}

static void port_self_test_pin(void *context, bool drive) {
    (void)context;
    if (BOARD_DIGITAL) {
        adxl355_self_test(drive);
    } else {
        pin_write(BOARD_SELF_TEST, drive);
    }
}

static impid_port_health_t port_health(void *context) {
    (void)context;
    impid_port_health_t health = {0};
    sampling_health(&health);
    serial_health(&health);
    can_health(&health);
    fault_health(&health);
    return health;
}

static void port_request_reset(void *context) {
    (void)context;
    reset_requested = true;
}

static const impid_port_t port = {
    .now_us = port_now_us,
    .serial_send = port_serial_send,
    .can_send = port_can_send,
    .backlog_us = port_backlog_us,
    .self_test_pin = port_self_test_pin,
    .health = port_health,
    .request_reset = port_request_reset,
};

static void set_pins_up(void) {
    clock_start_ports();
    pin_analogue(BOARD_ACCEL_X);
    pin_analogue(BOARD_ACCEL_Y);
    pin_output(BOARD_SELF_TEST);
    pin_output(BOARD_LED);
}

/* Slow blink: waiting for a command; fast: streaming or self-testing. */
static void show_state(uint32_t now_us) {
    bool busy = impid_stream_active(&core.stream) || impid_selftest_running(&core.selftest);
    pin_write(BOARD_LED, ((now_us >> (busy ? 17 : 19)) & 1u) != 0u);
}

static void refresh_watchdog(void) {
    static uint32_t ticks_seen;
    uint32_t ticks = sampling_ticks();
    if (ticks != ticks_seen) {
        ticks_seen = ticks;
        watchdog_refresh();
    }
}

static void reset_when_sent(void) {
    static uint32_t requested_at_tick;
    if (!reset_requested) {
        requested_at_tick = sampling_ticks();
    } else if ((serial_done() && can_backlog_us() == 0u) ||
               sampling_ticks() - requested_at_tick > RESET_PATIENCE_TICKS) {
        fault_reset();
    } else {
        /* bytes are still leaving */
    }
}

/* Until the next interrupt: the next tick is never further than a millisecond. The check and the wait are one
 * step to the interrupts, which wake the processor although they are masked. */
static void sleep_unless(bool work) {
    uint32_t before = interrupts_mask();
    if (!work && !serial_pending() && !can_pending()) {
        __asm volatile("wfi" ::: "memory");
    }
    interrupts_restore(before);
}

/* Which slot this image was linked for is an address that the linker knows. */
extern const uint8_t linker_slot_base[];

int main(void) {
    const impid_update_port_t slots = {
        .flash = &flash_slots,
        .base = {SLOT_0_BASE, SLOT_1_BASE},
        .running = (uint32_t)(uintptr_t)linker_slot_base == SLOT_1_BASE ? 1u : 0u,
    };
    uint8_t reset_cause = fault_reset_cause();
    watchdog_start();
    bool external_clock = clock_start();
    set_pins_up();
    sampling_measure_supply();

    impid_settings_init(&settings, &flash_settings);
    inputs_start(&settings);
    bench_start(&settings);
    (void)impid_settings_prepare(&settings);
    watchdog_refresh(); /* two erases may lie behind */
    uint32_t boot_count = impid_settings_count_boot(&settings);

    impid_core_config_t config = {
        .sensor = &BOARD_SENSOR,
        .uid = {UNIQUE_ID[0], UNIQUE_ID[1], UNIQUE_ID[2]},
        .board_id = BOARD_ID,
        .build_commit = IMPID_BUILD_COMMIT,
        .build_state = IMPID_BUILD_STATE,
        .boot_id = (uint16_t)boot_count,
        .reset_cause = reset_cause,
        .clock_source = external_clock ? IMPID_MESSAGES_STATUS_HEALTH_CLOCK_SOURCE_HSE_CHOICE
                                       : IMPID_MESSAGES_STATUS_HEALTH_CLOCK_SOURCE_HSI_CHOICE,
        .settings = &settings,
        .log = (const uint32_t *)(const void *)fault_log(),
        .external_clock_hz = clock_external_hz(),
        .log_words = FAULT_LOG_WORDS,
        .slots = &slots,
        .bench = BENCH_PORT,
        .trace = fault_trace(),
    };
    impid_core_init(&core, &config, &port);
    if (BOARD_DIGITAL) {
        adxl355_start();
    }
    sampling_start(&core); /* the time first: receive interrupts stamp with it */
    serial_start();
    can_start(settings.values[IMPID_SETTING_CAN_KBPS]);

    for (;;) {
        uint32_t ticks = sampling_ticks();
        serial_poll(&core);
        can_poll(&core);
        impid_core_poll(&core);
        show_state(timebase_now_us());
        refresh_watchdog();
        reset_when_sent();
        bench_poll();
        sleep_unless(ticks != sampling_ticks());
    }
}
