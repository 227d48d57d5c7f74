/* The native board end to end, through its public interface alone. */
#include "impid_board.h"
#include "impid_frame.h"

#include <string.h>
#include <unity.h>

#define TICKS 2000u

static impid_board *board;
static uint16_t adc[TICKS * IMPID_ADC_PER_TICK * 2u];
static int32_t encoder[TICKS * 2u];
static uint8_t faults[TICKS];
static uint8_t bytes[1u << 20];
static impid_board_can_frame can[1u << 13];

static void make_board(const impid_board_config *config) {
    impid_board_free(board);
    board = impid_board_new(config);
    TEST_ASSERT_NOT_NULL(board);
}

void setUp(void) {
    for (uint32_t i = 0; i < TICKS; i++) {
        for (uint32_t j = 0; j < 2u * IMPID_ADC_PER_TICK; j++) {
            adc[i * 2u * IMPID_ADC_PER_TICK + j] = 2048;
        }
        encoder[2u * i] = (int32_t)i;
        encoder[2u * i + 1u] = -(int32_t)i;
        faults[i] = 0;
    }
}

void tearDown(void) {
    impid_board_free(board);
    board = NULL;
}

static void send_with(uint16_t request_id, uint8_t opcode, uint8_t item, uint32_t value, uint64_t t_us) {
    struct impid_messages_command_t command = {
        .request_id = request_id, .opcode = opcode, .item = item, .value = value};
    struct impid_messages_batch_t header = {
        .kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 1};
    uint8_t record[8];
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    (void)impid_messages_command_pack(record, &command, sizeof record);
    impid_board_serial_receive(board, encoded, impid_frame_encode(&header, record, encoded), t_us);
}

static void send(uint16_t request_id, uint8_t opcode, uint64_t t_us) {
    send_with(request_id, opcode, 0, 0, t_us);
}

typedef struct {
    uint32_t samples;
    uint32_t gaps; /* indices left out between batches */
    uint32_t frames;
    uint32_t missing_frames; /* numbers left out between frames */
    struct impid_messages_pong_t pong;
    struct impid_messages_response_t response;
    struct impid_messages_status_samples_t status;
    struct impid_messages_status_link_t link;
} received_t;

static received_t receive(void) {
    received_t seen = {0};
    size_t count = impid_board_serial_take(board, bytes, sizeof bytes);
    impid_frame_parser_t parser;
    impid_frame_parser_init(&parser);
    impid_frame_view_t frame;
    uint32_t next_index = 0;
    uint16_t next_seq = 0;
    for (size_t i = 0; i < count; i++) {
        if (!impid_frame_parser_push(&parser, bytes[i], &frame)) {
            continue;
        }
        const struct impid_messages_batch_t *header = &frame.header;
        seen.frames++;
        seen.missing_frames += (uint16_t)(header->frame_seq - next_seq);
        next_seq = (uint16_t)(header->frame_seq + 1u);
        if (header->kind == IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE) {
            seen.gaps += header->first_index - next_index;
            next_index = header->first_index + header->count;
            seen.samples += header->count;
        } else if (header->kind == IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE) {
            (void)impid_messages_pong_unpack(&seen.pong, frame.records, 8);
        } else if (header->kind == IMPID_MESSAGES_BATCH_KIND_RESPONSE_CHOICE) {
            (void)impid_messages_response_unpack(&seen.response, frame.records, 8);
        } else if (header->kind == IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE) {
            (void)impid_messages_status_samples_unpack(&seen.status, frame.records, 8);
            (void)impid_messages_status_link_unpack(&seen.link, &frame.records[8], 8);
        }
    }
    TEST_ASSERT_EQUAL_UINT32(0, parser.damaged + parser.foreign);
    return seen;
}

static void test_every_sample_arrives(void) {
    make_board(&(impid_board_config){.serial_bytes_per_ms = 92});
    impid_board_run(board, 10, adc, encoder, NULL);
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 9500);
    impid_board_run(board, 1000, adc, encoder, faults);
    send(2, IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE, 1009500);
    impid_board_run(board, 100, adc, encoder, faults);
    received_t seen = receive();
    TEST_ASSERT_EQUAL_UINT32(1000, seen.samples);
    TEST_ASSERT_EQUAL_UINT32(0, seen.gaps + seen.missing_frames);
    TEST_ASSERT_EQUAL_UINT64(1109000, impid_board_now_us(board));
}

/* A line at half the rate that the stream needs: what is missing equals what
 * the board says it dropped. */
static void test_a_line_too_slow_loses_whole_frames_and_says_so(void) {
    make_board(&(impid_board_config){.serial_bytes_per_ms = 10});
    impid_board_run(board, 10, adc, encoder, NULL);
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 9500);
    impid_board_run(board, 1990, adc, encoder, NULL);
    send(2, IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE, 1999500);
    impid_board_run(board, 500, adc, encoder, NULL);
    send(3, IMPID_MESSAGES_COMMAND_OPCODE_STATUS_CHOICE, 2499500);
    impid_board_run(board, 200, adc, encoder, NULL);
    received_t seen = receive();
    TEST_ASSERT_GREATER_THAN_UINT32(50, seen.missing_frames);
    TEST_ASSERT_EQUAL_UINT32(seen.link.frames_dropped, seen.missing_frames);
    TEST_ASSERT_EQUAL_UINT32(1990, seen.status.produced);
    uint32_t lost = 1990u - seen.samples;
    TEST_ASSERT_EQUAL_UINT32(0, lost % IMPID_BATCH_SAMPLES);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(seen.missing_frames, lost / IMPID_BATCH_SAMPLES);
    TEST_ASSERT_EQUAL_UINT32(0, seen.status.ring_lost);
}

static void test_a_stalled_main_loop_loses_what_the_ring_cannot_hold(void) {
    make_board(&(impid_board_config){0});
    impid_board_run(board, 10, adc, encoder, NULL);
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 9500);
    memset(&faults[100], IMPID_BOARD_STALLED, 400);
    impid_board_run(board, 1000, adc, encoder, faults);
    received_t seen = receive();
    /* The tick after the stall still finds the ring full: 400 + 1 - 256. */
    TEST_ASSERT_EQUAL_UINT32(145, seen.status.ring_lost);
    TEST_ASSERT_EQUAL_UINT32(145, seen.gaps);
}

static void test_ping_between_ticks_and_across_the_wrap(void) {
    uint64_t start = 0x100000000ull - 2500u;
    make_board(&(impid_board_config){.start_us = start});
    impid_board_run(board, 3, adc, encoder, NULL);
    send(77, IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE, start + 2600u);
    TEST_ASSERT_EQUAL_UINT64(start + 2600u, impid_board_now_us(board));
    received_t seen = receive();
    TEST_ASSERT_EQUAL_UINT16(77, seen.pong.request_id);
    TEST_ASSERT_EQUAL_UINT32(100, seen.pong.t2_us);
    TEST_ASSERT_EQUAL_UINT16(0, seen.pong.hold_us);
    /* Delivered late: the stamp is the arrival's, the hold is what went by since.
     */
    impid_board_run(board, 2, adc, encoder, NULL);
    send(78, IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE, start + 3200u);
    seen = receive();
    TEST_ASSERT_EQUAL_UINT32(700, seen.pong.t2_us);
    TEST_ASSERT_EQUAL_UINT16(800, seen.pong.hold_us);
}

/* At 92 bytes a millisecond a pong behind another answer waits for what is left
 * of it; the hold includes that wait. */
static void test_hold_includes_what_is_under_way_on_the_line(void) {
    make_board(&(impid_board_config){.serial_bytes_per_ms = 92});
    impid_board_run(board, 10, adc, encoder, NULL);
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 9500); /* its answer: 34 bytes */
    send(2, IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE, 9600);
    impid_board_run(board, 5, adc, encoder, NULL);
    /* 34 bytes take 369.6 us, 100 of which have gone by. */
    TEST_ASSERT_EQUAL_UINT16(270, receive().pong.hold_us);
}

/* The answer to a ping leaves between ticks, byte by byte, not at the next
 * tick. */
static void test_the_line_carries_between_ticks(void) {
    make_board(&(impid_board_config){.serial_bytes_per_ms = 92});
    impid_board_run(board, 10, adc, encoder, NULL); /* the last at 9000 us */
    TEST_ASSERT_EQUAL_UINT64(9000, impid_board_lines_idle_us(board));
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE, 9100);
    TEST_ASSERT_EQUAL_UINT64(9100 + 370, impid_board_lines_idle_us(board));
    TEST_ASSERT_EQUAL_UINT(0, impid_board_serial_take(board, bytes, sizeof bytes));
    impid_board_advance(board, 9200); /* 9.2 bytes */
    TEST_ASSERT_EQUAL_UINT(9, impid_board_serial_take(board, bytes, sizeof bytes));
    impid_board_advance(board, 9300); /* 18.4 */
    TEST_ASSERT_EQUAL_UINT(9, impid_board_serial_take(board, &bytes[9], sizeof bytes - 9u));
    impid_board_advance(board, 9469);
    TEST_ASSERT_EQUAL_UINT(15, impid_board_serial_take(board, &bytes[18], sizeof bytes - 18u));
    impid_board_advance(board, 9470);
    TEST_ASSERT_EQUAL_UINT(1, impid_board_serial_take(board, &bytes[33], sizeof bytes - 33u));
    TEST_ASSERT_EQUAL_UINT8(0, bytes[33]); /* the delimiter */
    TEST_ASSERT_EQUAL_UINT64(9470, impid_board_now_us(board));
    impid_board_advance(board, 9000);
    TEST_ASSERT_EQUAL_UINT64(9470, impid_board_now_us(board));
}

static void test_bus_off_is_counted_and_recovered_from(void) {
    make_board(&(impid_board_config){.can_frames_per_ms = 7});
    impid_board_can_frame start = {.id = IMPID_MESSAGES_COMMAND_FRAME_ID, .dlc = 8};
    struct impid_messages_command_t command = {.request_id = 1,
                                               .opcode = IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE};
    (void)impid_messages_command_pack(start.data, &command, 8);
    impid_board_run(board, 10, adc, encoder, NULL);
    impid_board_can_receive(board, &start, 9500);
    impid_board_run(board, 100, adc, encoder, NULL);
    memset(faults, IMPID_BOARD_STALLED, 20);
    impid_board_can_bus_off(board);
    impid_board_run(board, 20, adc, encoder, faults);
    impid_board_run(board, 200, adc, encoder, NULL);
    size_t count = impid_board_can_take(board, can, sizeof can / sizeof can[0]);
    uint32_t samples = 0;
    struct impid_messages_status_bus_t bus = {0};
    for (size_t i = 0; i < count; i++) {
        samples += can[i].id == IMPID_MESSAGES_ENCODER_FRAME_ID;
        if (can[i].id == IMPID_MESSAGES_STATUS_BUS_FRAME_ID) {
            (void)impid_messages_status_bus_unpack(&bus, can[i].data, 8);
        }
    }
    TEST_ASSERT_EQUAL_UINT16(1, bus.bus_off);
    TEST_ASSERT_GREATER_THAN_UINT32(290, samples);
}

static void test_output_that_nobody_takes_is_dropped_and_counted(void) {
    make_board(&(impid_board_config){0});
    impid_board_run(board, 10, adc, encoder, NULL);
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 9500);
    for (uint32_t i = 0; i < 150u; i++) { /* 300 s: more than the line's 4 MiB */
        impid_board_run(board, TICKS, adc, encoder, NULL);
    }
    size_t left = 0;
    size_t taken;
    while ((taken = impid_board_serial_take(board, bytes, sizeof bytes)) > 0u) {
        left += taken;
    }
    TEST_ASSERT_TRUE(left <= IMPID_BOARD_SERIAL_CAPACITY && left > IMPID_BOARD_SERIAL_CAPACITY - 200u);
    send(2, IMPID_MESSAGES_COMMAND_OPCODE_STATUS_CHOICE, 300010000u);
    received_t seen = receive();
    TEST_ASSERT_GREATER_THAN_UINT32(1000, seen.link.frames_dropped);
    TEST_ASSERT_EQUAL_UINT32(300000, seen.status.produced);
}

static void test_two_boards_in_one_process_do_not_meet(void) {
    impid_board *other = impid_board_new(&(impid_board_config){.boot_id = 2});
    make_board(&(impid_board_config){.boot_id = 1});
    impid_board_run(board, 10, adc, encoder, NULL);
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 9500);
    impid_board_run(board, 50, adc, encoder, NULL);
    impid_board_run(other, 50, adc, encoder, NULL);
    TEST_ASSERT_EQUAL_UINT32(50, receive().samples);
    TEST_ASSERT_EQUAL_UINT(0, impid_board_serial_take(other, bytes, sizeof bytes));
    impid_board_free(other);
}

static void test_pin_and_reset_are_visible(void) {
    make_board(&(impid_board_config){0});
    send(1, IMPID_MESSAGES_COMMAND_OPCODE_SELF_TEST_CHOICE, 0);
    TEST_ASSERT_EQUAL_INT(0, impid_board_self_test_pin(board));
    impid_board_run(board, 200, adc, encoder, NULL);
    TEST_ASSERT_EQUAL_INT(1, impid_board_self_test_pin(board));
    impid_board_run(board, 300, adc, encoder, NULL);
    TEST_ASSERT_EQUAL_INT(0, impid_board_self_test_pin(board));
    TEST_ASSERT_EQUAL_INT(0, impid_board_reset_requested(board));
    send(2, IMPID_MESSAGES_COMMAND_OPCODE_RESET_CHOICE, 600000);
    TEST_ASSERT_EQUAL_INT(1, impid_board_reset_requested(board));
}

static uint32_t value_of(uint16_t request_id, uint8_t opcode, uint8_t item) {
    send_with(request_id, opcode, item, 0, 0);
    struct impid_messages_response_t response = receive().response;
    TEST_ASSERT_EQUAL_UINT16(request_id, response.request_id);
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE, response.result);
    return response.value;
}

#define GET  IMPID_MESSAGES_COMMAND_OPCODE_GET_CHOICE
#define SET  IMPID_MESSAGES_COMMAND_OPCODE_SET_CHOICE
#define SAVE IMPID_MESSAGES_COMMAND_OPCODE_SAVE_CHOICE
#define CPR  IMPID_MESSAGES_COMMAND_ITEM_ENCODER_1_CPR_CHOICE
#define BOOT IMPID_MESSAGES_COMMAND_ITEM_BOOT_COUNT_CHOICE

/* The flash is the caller's: a board made anew on it finds what the one before saved, and nothing else. */
static void test_settings_outlive_the_board_in_the_flash_that_it_is_given(void) {
    static uint32_t words[IMPID_BOARD_FLASH_WORDS];
    memset(words, 0xFF, sizeof words);
    const impid_board_config config = {.flash = words};
    make_board(&config);
    TEST_ASSERT_EQUAL_UINT32(1, value_of(1, GET, BOOT));
    send_with(2, SET, CPR, 8192, 0);
    (void)value_of(3, SAVE, 0);
    send_with(4, SET, CPR, 4096, 0);
    TEST_ASSERT_EQUAL_UINT32(4096, value_of(5, GET, CPR));
    make_board(&config);
    TEST_ASSERT_EQUAL_UINT32(2, value_of(1, GET, BOOT));
    TEST_ASSERT_EQUAL_UINT32(8192, value_of(2, GET, CPR));
    make_board(&(impid_board_config){0});
    TEST_ASSERT_EQUAL_UINT32(1, value_of(1, GET, BOOT));
    TEST_ASSERT_EQUAL_UINT32(0, value_of(2, GET, CPR));
    TEST_ASSERT_EQUAL_UINT32(0, value_of(3, IMPID_MESSAGES_COMMAND_OPCODE_LOG_CHOICE,
                                         IMPID_MESSAGES_COMMAND_ITEM_FAULT_UPTIME_US_CHOICE));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_every_sample_arrives);
    RUN_TEST(test_a_line_too_slow_loses_whole_frames_and_says_so);
    RUN_TEST(test_a_stalled_main_loop_loses_what_the_ring_cannot_hold);
    RUN_TEST(test_ping_between_ticks_and_across_the_wrap);
    RUN_TEST(test_hold_includes_what_is_under_way_on_the_line);
    RUN_TEST(test_the_line_carries_between_ticks);
    RUN_TEST(test_bus_off_is_counted_and_recovered_from);
    RUN_TEST(test_output_that_nobody_takes_is_dropped_and_counted);
    RUN_TEST(test_two_boards_in_one_process_do_not_meet);
    RUN_TEST(test_pin_and_reset_are_visible);
    RUN_TEST(test_settings_outlive_the_board_in_the_flash_that_it_is_given);
    return UNITY_END();
}
