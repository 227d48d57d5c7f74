#include "fake_port.h"
#include "impid_status.h"

#include <string.h>
#include <unity.h>

#define INFO      IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE
#define START     IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE
#define STOP      IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE
#define PING      IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE
#define SELF_TEST IMPID_MESSAGES_COMMAND_OPCODE_SELF_TEST_CHOICE
#define STATUS    IMPID_MESSAGES_COMMAND_OPCODE_STATUS_CHOICE
#define RESET     IMPID_MESSAGES_COMMAND_OPCODE_RESET_CHOICE
#define SERIAL    IMPID_CARRIER_SERIAL
#define CAN       IMPID_CARRIER_CAN

#define OK             IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE
#define UNKNOWN_OPCODE IMPID_MESSAGES_RESPONSE_RESULT_UNKNOWN_OPCODE_CHOICE
#define BAD_ITEM       IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE
#define BAD_VALUE      IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE
#define BUSY           IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE

static fake_port_t fake;
static impid_core_t core;
static uint16_t next_id;

void setUp(void) {
    const impid_core_config_t config = {.uid = {0x11, 0x22, 0x33},
                                        .boot_id = 0xABCD,
                                        .reset_cause = 4,
                                        .clock_source = 1,
                                        .external_clock_hz = 8000321,
                                        .first_index = 50,
                                        .boot_us = 0};
    fake_port_init(&fake);
    impid_core_init(&core, &config, &fake.port);
    next_id = 1;
}

void tearDown(void) {
}

static void run(uint32_t periods) {
    for (uint32_t i = 0; i < periods; i++) {
        fake_period(&core, &fake, 2048, 2048, 0);
    }
}

static void ask(uint8_t opcode, uint8_t item, uint32_t value) {
    fake_send_command(&core, SERIAL, next_id++, opcode, item, value, fake.now_us);
}

static void check_answer(uint8_t opcode, uint8_t result, uint32_t value) {
    struct impid_messages_response_t response = fake_response(&fake);
    TEST_ASSERT_EQUAL_UINT16(next_id - 1u, response.request_id);
    TEST_ASSERT_EQUAL_UINT8(opcode, response.opcode);
    TEST_ASSERT_EQUAL_UINT8(result, response.result);
    TEST_ASSERT_EQUAL_UINT32(value, response.value);
}

static void test_every_info_item(void) {
    const uint32_t values[] = {1,       0x000200, 0x11, 0x22, 0x33, 0xABCD, 1000, 2006,
                               65536,   3300,     10,   8,    4,    1,      0,    0,
                               7654321, 3,        0,    0,    0,    2,      0,    8000321};
    for (uint8_t item = 0; item < sizeof values / sizeof values[0]; item++) {
        ask(INFO, item, 0);
        check_answer(INFO, OK, values[item]);
    }
    ask(INFO, sizeof values / sizeof values[0], 0);
    check_answer(INFO, BAD_ITEM, 0);
    ask(INFO, 255, 0);
    check_answer(INFO, BAD_ITEM, 0);
}

static void test_start_streams_and_stop_delivers_everything_first(void) {
    run(10);
    ask(START, 0, 0);
    check_answer(START, OK, 50);
    run(37);
    ask(STOP, 0, 0);
    check_answer(STOP, OK, 37);
    uint32_t samples = 0;
    for (uint32_t i = 0; i < fake.frames; i++) {
        samples +=
            fake.headers[i].kind == IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE ? fake.headers[i].count : 0u;
    }
    TEST_ASSERT_EQUAL_UINT32(37, samples);
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE, fake.headers[fake.frames - 2u].kind);
    uint32_t frames = fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE);
    run(50);
    TEST_ASSERT_EQUAL_UINT32(frames, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
}

static void test_start_refuses_a_value_and_a_running_self_test(void) {
    ask(START, 0, 1);
    check_answer(START, BAD_VALUE, 0);
    ask(SELF_TEST, 0, 0);
    check_answer(SELF_TEST, OK, 0);
    ask(START, 0, 0);
    check_answer(START, BUSY, 0);
    ask(SELF_TEST, 0, 0);
    check_answer(SELF_TEST, BUSY, 0);
}

static void test_self_test_refuses_to_disturb_a_stream(void) {
    ask(START, 0, 0);
    ask(SELF_TEST, 0, 0);
    check_answer(SELF_TEST, BUSY, 0);
    TEST_ASSERT_FALSE(fake.pin);
}

static void test_ping_tells_its_arrival_and_the_hold(void) {
    fake.now_us = 5000900;
    fake.backlog_us = 250;
    fake_send_command(&core, SERIAL, 321, PING, 0, 0, 5000123);
    struct impid_messages_pong_t pong;
    (void)impid_messages_pong_unpack(&pong, fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE),
                                     8);
    TEST_ASSERT_EQUAL_UINT16(321, pong.request_id);
    TEST_ASSERT_EQUAL_UINT32(5000123, pong.t2_us);
    TEST_ASSERT_EQUAL_UINT16(777 + 250, pong.hold_us);
    /* The same number again: a ping of its own. */
    fake.now_us = 5010000;
    fake.backlog_us = 100000;
    fake_send_command(&core, SERIAL, 321, PING, 0, 0, 5009990);
    (void)impid_messages_pong_unpack(&pong, fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE),
                                     8);
    TEST_ASSERT_EQUAL_UINT32(5009990, pong.t2_us);
    TEST_ASSERT_EQUAL_UINT16(UINT16_MAX, pong.hold_us); /* as much as the field holds */
    TEST_ASSERT_EQUAL_UINT32(2, core.accepted);
}

static void test_ping_on_can_is_answered_on_can(void) {
    fake.now_us = 5000900;
    fake_send_command(&core, CAN, 321, PING, 0, 0, 5000123);
    TEST_ASSERT_EQUAL_UINT32(0, fake.frames);
    TEST_ASSERT_EQUAL_UINT32(1, fake.can_frames);
    TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_PONG_FRAME_ID, fake.can[0].id);
    struct impid_messages_pong_t pong;
    (void)impid_messages_pong_unpack(&pong, fake.can[0].data, 8);
    TEST_ASSERT_EQUAL_UINT16(321, pong.request_id);
    TEST_ASSERT_EQUAL_UINT32(5000123, pong.t2_us);
    TEST_ASSERT_EQUAL_UINT16(777, pong.hold_us);
}

static void test_stop_without_a_stream_is_answered_and_sends_nothing_else(void) {
    run(10);
    ask(STOP, 0, 0);
    check_answer(STOP, OK, 0);
    TEST_ASSERT_EQUAL_UINT32(1, fake.frames);
}

static void test_reset_answers_first(void) {
    ask(RESET, 0, 0);
    check_answer(RESET, OK, 0);
    TEST_ASSERT_TRUE(fake.reset_requested);
}

static void test_opcodes_that_do_not_exist_are_refused_and_counted(void) {
    const uint8_t opcodes[] = {0, 7, 8, 9, 11, 12, 255};
    for (uint32_t i = 0; i < sizeof opcodes; i++) {
        ask(opcodes[i], 0, 0);
        check_answer(opcodes[i], UNKNOWN_OPCODE, 0);
        TEST_ASSERT_EQUAL_UINT32(i + 1u, core.rejected);
    }
    TEST_ASSERT_EQUAL_UINT32(0, core.accepted);
}

static void test_a_repeated_request_gets_the_same_answer_and_acts_once(void) {
    run(10);
    fake_send_command(&core, SERIAL, 7, START, 0, 0, 0);
    run(25);
    fake_send_command(&core, SERIAL, 8, STOP, 0, 0, 0);
    run(5);
    uint32_t accepted = core.accepted;
    fake_send_command(&core, SERIAL, 7, START, 0, 0, 0); /* a late copy must not start anew */
    TEST_ASSERT_EQUAL_UINT8(START, fake_response(&fake).opcode);
    TEST_ASSERT_EQUAL_UINT32(50, fake_response(&fake).value);
    TEST_ASSERT_FALSE(impid_stream_active(&core.stream));
    fake_send_command(&core, SERIAL, 8, STOP, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(25, fake_response(&fake).value);
    TEST_ASSERT_EQUAL_UINT32(accepted, core.accepted);
    /* The same number for something else, or from another host on the other carrier, is a new request. */
    fake_send_command(&core, SERIAL, 7, INFO, 6, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(1000, fake_response(&fake).value);
    fake_send_command(&core, SERIAL, 7, INFO, 7, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(2006, fake_response(&fake).value);
    fake_send_command(&core, SERIAL, 7, INFO, 7, 1, 0);
    TEST_ASSERT_EQUAL_UINT32(accepted + 3u, core.accepted);
    fake_send_command(&core, CAN, 7, START, 0, 0, 0);
    TEST_ASSERT_TRUE(impid_stream_active(&core.stream));
}

static void test_a_number_used_again_after_two_seconds_or_eight_requests_is_new(void) {
    fake_send_command(&core, SERIAL, 7, START, 0, 0, 0);
    fake_send_command(&core, SERIAL, 8, STOP, 0, 0, 0);
    fake.now_us += IMPID_REPLY_LIFETIME_US + 1u;
    fake_send_command(&core, SERIAL, 7, START, 0, 0, 0);
    TEST_ASSERT_TRUE(impid_stream_active(&core.stream));
    fake_send_command(&core, SERIAL, 8, STOP, 0, 0, 0);
    TEST_ASSERT_FALSE(impid_stream_active(&core.stream));
    for (uint16_t id = 100; id < 100u + IMPID_REPLIES; id++) {
        fake_send_command(&core, SERIAL, id, INFO, 0, 0, 0);
    }
    fake_send_command(&core, SERIAL, 7, START, 0, 0, 0);
    TEST_ASSERT_TRUE(impid_stream_active(&core.stream));
}

static void test_each_carrier_gets_the_stream_that_it_asked_for(void) {
    run(10);
    fake_send_command(&core, CAN, 1, START, 0, 0, 0);
    run(20);
    TEST_ASSERT_EQUAL_UINT32(0, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
    TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_ENCODER_FRAME_ID, fake.can[fake.can_frames - 1u].id);
    fake_send_command(&core, SERIAL, 1, START, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(70, fake_response(&fake).value);
    run(10);
    TEST_ASSERT_EQUAL_UINT32(1, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
    fake_send_command(&core, CAN, 2, STOP, 0, 0, 0);
    run(10);
    TEST_ASSERT_EQUAL_UINT32(2, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
    fake_send_command(&core, SERIAL, 2, STOP, 0, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(40, fake_response(&fake).value);
}

static void test_damaged_and_foreign_input_is_counted(void) {
    const uint8_t noise[] = {1, 2, 3, 0};
    impid_core_serial_receive(&core, noise, sizeof noise, 0);
    struct impid_messages_batch_t header = {
        .kind = IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 1};
    uint8_t record[8] = {0};
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    impid_core_serial_receive(&core, encoded, impid_frame_encode(&header, record, encoded), 0);
    header.version++; /* a host of another protocol */
    header.kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE;
    impid_core_serial_receive(&core, encoded, impid_frame_encode(&header, record, encoded), 0);
    impid_can_frame_t can = {.id = IMPID_MESSAGES_COMMAND_FRAME_ID, .dlc = 7};
    impid_core_can_receive(&core, &can, 0);
    can = (impid_can_frame_t){.id = 0x7FF, .dlc = 8}; /* other traffic on a shared bus */
    impid_core_can_receive(&core, &can, 0);
    fake.rejected = 30; /* by the port, which had no room for them */
    ask(STATUS, 0, 0);
    struct impid_messages_status_commands_t commands;
    const uint8_t *status = fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE);
    (void)impid_messages_status_commands_unpack(&commands, &status[32], 8);
    TEST_ASSERT_EQUAL_UINT32(34, commands.rejected);
    TEST_ASSERT_EQUAL_UINT32(1, commands.accepted);
}

static void test_status_tells_all_its_counters(void) {
    run(10);
    ask(START, 0, 0);
    for (uint32_t i = 0; i < 30u; i++) {
        fake_period(&core, &fake, i == 20u ? 4095 : 2048, 2048,
                    (uint8_t)((i == 3u ? IMPID_FLAG_LATE : 0u) | (i == 4u ? IMPID_FLAG_ENCODER_FAULT : 0u)));
    }
    impid_core_missed(&core, 2);
    fake.now_us += 2000;
    run(20);
    fake.now_us = 7900000;
    ask(STATUS, 0, 0);
    const uint8_t *record = fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE);
    impid_status_t status;
    (void)impid_messages_status_samples_unpack(&status.samples, &record[0], 8);
    (void)impid_messages_status_link_unpack(&status.link, &record[8], 8);
    (void)impid_messages_status_timing_unpack(&status.timing, &record[16], 8);
    (void)impid_messages_status_sensors_unpack(&status.sensors, &record[24], 8);
    (void)impid_messages_status_health_unpack(&status.health, &record[40], 8);
    (void)impid_messages_status_bus_unpack(&status.bus, &record[48], 8);
    TEST_ASSERT_EQUAL_UINT32(52, status.samples.produced);
    TEST_ASSERT_EQUAL_UINT32(0, status.samples.ring_lost);
    TEST_ASSERT_EQUAL_UINT32(fake.frames - 1u, status.link.frames_sent);
    TEST_ASSERT_EQUAL_UINT32(0, status.link.frames_dropped);
    TEST_ASSERT_EQUAL_UINT32(1, status.timing.late);
    TEST_ASSERT_EQUAL_UINT32(5, status.timing.overruns);
    TEST_ASSERT_EQUAL_UINT32(4, status.sensors.saturated);
    TEST_ASSERT_EQUAL_UINT32(1, status.sensors.encoder_faults);
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_STATE_STREAMING_CHOICE, status.health.state);
    TEST_ASSERT_EQUAL_UINT8(4, status.health.reset_cause);
    TEST_ASSERT_EQUAL_UINT8(1, status.health.clock_source);
    TEST_ASSERT_EQUAL_UINT8(0, status.health.self_test);
    TEST_ASSERT_EQUAL_UINT16(3300, status.health.supply_m_v);
    TEST_ASSERT_EQUAL_UINT16(42, status.health.worst_tick_us);
    TEST_ASSERT_EQUAL_UINT16(3, status.bus.bus_off);
    TEST_ASSERT_EQUAL_UINT8(17, status.bus.tx_errors);
    TEST_ASSERT_EQUAL_UINT8(19, status.bus.rx_errors);
    TEST_ASSERT_EQUAL_UINT32(7, status.bus.uptime_s);
    (void)impid_messages_status_losses_unpack(&status.losses, &record[56], 8);
    TEST_ASSERT_EQUAL_UINT16(21, status.losses.line_errors);
    TEST_ASSERT_EQUAL_UINT16(22, status.losses.can_overruns);
    TEST_ASSERT_EQUAL_UINT16(23, status.losses.adc_overruns);
    TEST_ASSERT_EQUAL_UINT16(24, status.losses.dma_errors);
}

static void test_status_comes_ten_times_a_second_on_both_carriers_unasked(void) {
    run(1000);
    TEST_ASSERT_EQUAL_UINT32(10, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE));
    /* STATUS_BUS closes the set. */
    static const uint16_t order[8] = {0x120, 0x121, 0x122, 0x123, 0x124, 0x125, 0x127, 0x126};
    TEST_ASSERT_EQUAL_UINT32(80, fake.can_frames);
    for (uint32_t i = 0; i < 80u; i++) {
        TEST_ASSERT_EQUAL_HEX16(order[i % 8u], fake.can[i].id);
    }
    struct impid_messages_status_losses_t losses;
    (void)impid_messages_status_losses_unpack(&losses, fake.can[6].data, 8);
    TEST_ASSERT_EQUAL_UINT16(21, losses.line_errors);
    struct impid_messages_status_bus_t bus;
    (void)impid_messages_status_bus_unpack(&bus, fake.can[7].data, 8);
    TEST_ASSERT_EQUAL_UINT8(17, bus.tx_errors);
    fake.now_us += 1000000; /* the main loop stood still: no burst afterwards */
    run(1);
    TEST_ASSERT_EQUAL_UINT32(11, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_every_info_item);
    RUN_TEST(test_start_streams_and_stop_delivers_everything_first);
    RUN_TEST(test_start_refuses_a_value_and_a_running_self_test);
    RUN_TEST(test_self_test_refuses_to_disturb_a_stream);
    RUN_TEST(test_ping_tells_its_arrival_and_the_hold);
    RUN_TEST(test_ping_on_can_is_answered_on_can);
    RUN_TEST(test_stop_without_a_stream_is_answered_and_sends_nothing_else);
    RUN_TEST(test_reset_answers_first);
    RUN_TEST(test_opcodes_that_do_not_exist_are_refused_and_counted);
    RUN_TEST(test_a_repeated_request_gets_the_same_answer_and_acts_once);
    RUN_TEST(test_a_number_used_again_after_two_seconds_or_eight_requests_is_new);
    RUN_TEST(test_each_carrier_gets_the_stream_that_it_asked_for);
    RUN_TEST(test_damaged_and_foreign_input_is_counted);
    RUN_TEST(test_status_tells_all_its_counters);
    RUN_TEST(test_status_comes_ten_times_a_second_on_both_carriers_unasked);
    return UNITY_END();
}
