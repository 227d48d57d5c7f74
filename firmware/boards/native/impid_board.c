#include "impid_board.h"

#include "impid_assert.h"
#include "impid_build.h"
#include "impid_core.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The transmit queues of the port, as a board has them: with a line of finite speed, what does not fit is
 * refused and the core counts it. */
#define SERIAL_QUEUE 1024u
#define CAN_QUEUE    64u

#define VREF_MV 3300u

#define FAULT_WORDS  9u
#define LOG_WORDS    (FAULT_WORDS + 2u)
#define SECTOR_WORDS (IMPID_BOARD_FLASH_WORDS / IMPID_SETTINGS_SECTORS)

/* How far a line of `per_ms` units (bytes or frames) a millisecond has come. */
typedef struct {
    uint64_t at_us;  /* what could leave until here has left */
    uint64_t credit; /* thousandths of the next unit that have left already */
} line_t;

struct impid_board {
    impid_core_t core;
    impid_port_t port;
    impid_flash_t flash_port;
    impid_settings_t settings;
    impid_trace_t own_trace;
    uint32_t log[LOG_WORDS]; /* as on the chip; a process that faults leaves no fault behind */
    impid_board_config config;
    uint64_t now_us;
    uint64_t next_tick_us;
    bool self_test_pin;
    bool reset_requested;
    bool bus_is_off;
    uint16_t bus_off;
    uint32_t sync_us;
    uint32_t sync_count;
    line_t serial_line;
    line_t can_line;
    /* Bytes and frames: those up to `left` have passed the line and may be taken, the rest is queued. */
    size_t serial_used;
    size_t serial_left;
    size_t can_used;
    size_t can_left;
    uint8_t serial[IMPID_BOARD_SERIAL_CAPACITY];
    impid_board_can_frame can[IMPID_BOARD_CAN_CAPACITY];
    uint32_t own_flash[IMPID_BOARD_FLASH_WORDS];
    uint32_t *flash; /* this one, or the caller's */
};

_Noreturn void impid_assert_failed(const char *what) {
    (void)fprintf(stderr, "the firmware core is wrong: %s does not hold\n",
                  what != NULL ? what : "something");
    abort();
}

static uint32_t port_now_us(void *context) {
    const impid_board *board = context;
    return (uint32_t)board->now_us;
}

/* How many of `queued` units leave between the line's last time and t_us. An idle line saves nothing up. */
static size_t carried(line_t *line, uint32_t per_ms, size_t queued, uint64_t t_us) {
    uint64_t credit = line->credit + (t_us - line->at_us) * per_ms;
    line->at_us = t_us;
    size_t count = credit / 1000u < queued ? (size_t)(credit / 1000u) : queued;
    line->credit = count == queued ? 0u : credit % 1000u;
    return count;
}

static void advance_lines(impid_board *board) {
    uint32_t bytes_per_ms = board->config.serial_bytes_per_ms;
    uint32_t frames_per_ms = board->config.can_frames_per_ms;
    if (bytes_per_ms > 0u) {
        size_t queued = board->serial_used - board->serial_left;
        board->serial_left += carried(&board->serial_line, bytes_per_ms, queued, board->now_us);
    }
    if (frames_per_ms > 0u) {
        size_t queued = board->can_used - board->can_left;
        board->can_left += carried(&board->can_line, frames_per_ms, queued, board->now_us);
    }
}

/* Until `queued` units have left, rounded up. */
static uint64_t wait_us(const line_t *line, uint32_t per_ms, size_t queued) {
    return per_ms == 0u || queued == 0u ? 0u : (queued * 1000u - line->credit + per_ms - 1u) / per_ms;
}

static bool port_serial_send(void *context, const uint8_t *bytes, size_t count) {
    impid_board *board = context;
    bool limited = board->config.serial_bytes_per_ms > 0u;
    size_t queued = board->serial_used - board->serial_left;
    if (count > sizeof board->serial - board->serial_used || (limited && queued + count > SERIAL_QUEUE)) {
        return false;
    }
    memcpy(&board->serial[board->serial_used], bytes, count);
    board->serial_used += count;
    if (!limited) {
        board->serial_left = board->serial_used;
    }
    return true;
}

static bool port_can_send(void *context, const impid_can_frame_t *frame) {
    impid_board *board = context;
    bool limited = board->config.can_frames_per_ms > 0u;
    size_t queued = board->can_used - board->can_left;
    if (board->bus_is_off || board->can_used == IMPID_BOARD_CAN_CAPACITY ||
        (limited && queued >= CAN_QUEUE)) {
        return false;
    }
    impid_board_can_frame *slot = &board->can[board->can_used++];
    slot->id = frame->id;
    slot->dlc = frame->dlc;
    memcpy(slot->data, frame->data, sizeof slot->data);
    if (!limited) {
        board->can_left = board->can_used;
    }
    return true;
}

static uint32_t port_backlog_us(void *context, impid_carrier_t carrier) {
    const impid_board *board = context;
    bool serial = carrier == IMPID_CARRIER_SERIAL;
    size_t queued = serial ? board->serial_used - board->serial_left : board->can_used - board->can_left;
    return (uint32_t)(serial ? wait_us(&board->serial_line, board->config.serial_bytes_per_ms, queued)
                             : wait_us(&board->can_line, board->config.can_frames_per_ms, queued));
}

static void port_self_test_pin(void *context, bool drive) {
    impid_board *board = context;
    board->self_test_pin = drive;
}

static impid_port_health_t port_health(void *context) {
    const impid_board *board = context;
    return (impid_port_health_t){.bus_off = board->bus_off,
                                 .supply_mV = VREF_MV,
                                 .sync_us = board->sync_us,
                                 .sync_count = board->sync_count};
}

static void port_request_reset(void *context) {
    impid_board *board = context;
    board->reset_requested = true;
}

static uint32_t flash_read(void *context, uint32_t sector, uint32_t word) {
    const impid_board *board = context;
    return board->flash[sector * SECTOR_WORDS + word];
}

static bool flash_program(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    impid_board *board = context;
    board->flash[sector * SECTOR_WORDS + word] &= value;
    return true;
}

static bool flash_erase(void *context, uint32_t sector) {
    impid_board *board = context;
    memset(&board->flash[sector * SECTOR_WORDS], 0xFF, SECTOR_WORDS * sizeof board->flash[0]);
    return true;
}

static void start_settings(impid_board *board, uint32_t *flash) {
    memset(board->own_flash, 0xFF, sizeof board->own_flash);
    board->flash = flash != NULL ? flash : board->own_flash;
    board->flash_port = (impid_flash_t){.context = board,
                                        .sector_words = SECTOR_WORDS,
                                        .read = flash_read,
                                        .program = flash_program,
                                        .erase = flash_erase};
    impid_settings_init(&board->settings, &board->flash_port);
    (void)impid_settings_prepare(&board->settings);
    (void)impid_settings_count_boot(&board->settings);
}

_Static_assert(sizeof(impid_trace_t) == IMPID_BOARD_RETAINED_WORDS * sizeof(uint32_t), "one fits the other");

static impid_trace_t *last_stream(impid_board *board, uint32_t *retained) {
    impid_trace_t *trace = retained != NULL ? (impid_trace_t *)(void *)retained : &board->own_trace;
    (void)impid_trace_read(trace, &board->log[FAULT_WORDS], &board->log[FAULT_WORDS + 1u]);
    return trace;
}

impid_board *impid_board_new(const impid_board_config *config) {
    impid_board *board = calloc(1, sizeof *board);
    if (board == NULL) {
        return NULL;
    }
    board->config = *config;
    board->now_us = config->start_us;
    board->next_tick_us = config->start_us;
    board->serial_line.at_us = config->start_us;
    board->can_line.at_us = config->start_us;
    board->port = (impid_port_t){.context = board,
                                 .now_us = port_now_us,
                                 .serial_send = port_serial_send,
                                 .can_send = port_can_send,
                                 .backlog_us = port_backlog_us,
                                 .self_test_pin = port_self_test_pin,
                                 .health = port_health,
                                 .request_reset = port_request_reset};
    start_settings(board, config->flash);
    impid_core_config_t core_config = {.sensor = config->digital ? &impid_adxl355 : &impid_adxl203,
                                       .uid = {config->uid[0], config->uid[1], config->uid[2]},
                                       .boot_id = config->boot_id,
                                       .reset_cause = config->reset_cause,
                                       .clock_source =
                                           IMPID_MESSAGES_STATUS_HEALTH_CLOCK_SOURCE_NATIVE_CHOICE,
                                       .build_commit = IMPID_BUILD_COMMIT,
                                       .build_state = IMPID_BUILD_STATE,
                                       .first_index = config->first_index,
                                       .boot_us = config->start_us,
                                       .settings = &board->settings,
                                       .log = board->log,
                                       .log_words = LOG_WORDS,
                                       .trace = last_stream(board, config->retained)};
    impid_core_init(&board->core, &core_config, &board->port);
    return board;
}

void impid_board_free(impid_board *board) {
    free(board);
}

static void advance_clock(impid_board *board, uint64_t t_us) {
    if (board->now_us < t_us) {
        board->now_us = t_us;
    }
    advance_lines(board);
}

static uint8_t tick_flags(uint8_t faults) {
    return (uint8_t)(((faults & IMPID_BOARD_ENCODER_FAULT) ? IMPID_FLAG_ENCODER_FAULT : 0u) |
                     ((faults & IMPID_BOARD_SYNC_EDGE) ? IMPID_FLAG_SYNC_EDGE : 0u) |
                     ((faults & IMPID_BOARD_LATE) ? IMPID_FLAG_LATE : 0u));
}

static void run_tick(impid_board *board, impid_tick_t *tick, const int32_t *encoder, uint8_t fault) {
    tick->encoder[0] = (uint32_t)encoder[0];
    tick->encoder[1] = (uint32_t)encoder[1];
    tick->t_us = (uint32_t)board->next_tick_us;
    tick->flags = tick_flags(fault);
    advance_clock(board, board->next_tick_us);
    board->next_tick_us += IMPID_PERIOD_US;
    if (fault & IMPID_BOARD_SYNC_EDGE) {
        board->sync_us = tick->t_us;
        board->sync_count++;
    }
    impid_core_tick(&board->core, tick);
    if (!(fault & IMPID_BOARD_STALLED)) {
        board->bus_is_off = false;
        impid_core_poll(&board->core);
    }
}

void impid_board_run(impid_board *board, size_t ticks, const uint16_t *adc, const int32_t *encoder,
                     const uint8_t *faults) {
    for (size_t i = 0; i < ticks; i++) {
        impid_tick_t tick = {.adc = &adc[i * IMPID_ADC_PER_TICK * 2u]};
        run_tick(board, &tick, &encoder[2u * i], faults == NULL ? 0u : faults[i]);
    }
}

void impid_board_run_wide(impid_board *board, size_t ticks, const uint32_t *readings, const int32_t *encoder,
                          const uint8_t *faults) {
    for (size_t i = 0; i < ticks; i++) {
        impid_tick_t tick = {.wide = &readings[i * 3u]};
        run_tick(board, &tick, &encoder[2u * i], faults == NULL ? 0u : faults[i]);
    }
}

uint64_t impid_board_now_us(const impid_board *board) {
    return board->now_us;
}

void impid_board_advance(impid_board *board, uint64_t t_us) {
    advance_clock(board, t_us);
}

uint64_t impid_board_lines_idle_us(const impid_board *board) {
    uint64_t serial = wait_us(&board->serial_line, board->config.serial_bytes_per_ms,
                              board->serial_used - board->serial_left);
    uint64_t can =
        wait_us(&board->can_line, board->config.can_frames_per_ms, board->can_used - board->can_left);
    return board->now_us + (serial > can ? serial : can);
}

void impid_board_serial_receive(impid_board *board, const uint8_t *bytes, size_t count, uint64_t t_us) {
    advance_clock(board, t_us);
    impid_core_serial_receive(&board->core, bytes, count, (uint32_t)t_us);
}

void impid_board_can_receive(impid_board *board, const impid_board_can_frame *frame, uint64_t t_us) {
    advance_clock(board, t_us);
    impid_can_frame_t received = {.id = frame->id, .dlc = frame->dlc};
    memcpy(received.data, frame->data, sizeof received.data);
    impid_core_can_receive(&board->core, &received, (uint32_t)t_us);
}

size_t impid_board_serial_take(impid_board *board, uint8_t *out, size_t capacity) {
    size_t count = board->serial_left < capacity ? board->serial_left : capacity;
    memcpy(out, board->serial, count);
    memmove(board->serial, &board->serial[count], board->serial_used - count);
    board->serial_used -= count;
    board->serial_left -= count;
    return count;
}

size_t impid_board_can_take(impid_board *board, impid_board_can_frame *out, size_t capacity) {
    size_t count = board->can_left < capacity ? board->can_left : capacity;
    memcpy(out, board->can, count * sizeof *out);
    memmove(board->can, &board->can[count], (board->can_used - count) * sizeof *out);
    board->can_used -= count;
    board->can_left -= count;
    return count;
}

void impid_board_can_bus_off(impid_board *board) {
    board->bus_off++;
    board->bus_is_off = true;
    /* The controller aborts what waits in its mailboxes; those frames never reached the bus. */
    board->can_used = board->can_left;
}

int impid_board_streaming(const impid_board *board) {
    return impid_stream_active(&board->core.stream);
}

int impid_board_self_test_pin(const impid_board *board) {
    return board->self_test_pin;
}

int impid_board_reset_requested(const impid_board *board) {
    return board->reset_requested;
}
