/* BENCH as the core has it: the histogram, what goes to the board, and when it is refused. */
#include "fake_port.h"

#include <unity.h>

#define BENCH IMPID_MESSAGES_COMMAND_OPCODE_BENCH_CHOICE
#define INFO  IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE
#define START IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE
#define STOP  IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE

#define EDGE           IMPID_MESSAGES_COMMAND_ITEM_BENCH_EDGE_CHOICE
#define CAN_LOOPBACK   IMPID_MESSAGES_COMMAND_ITEM_BENCH_CAN_LOOPBACK_CHOICE
#define HISTOGRAM      IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_CHOICE
#define HISTOGRAM_LEFT IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_LEFT_CHOICE
#define HISTOGRAM_BASE IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_BASE_CHOICE
#define HISTOGRAM_BIN  IMPID_MESSAGES_COMMAND_ITEM_BENCH_HISTOGRAM_BIN_CHOICE

#define OK        IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE
#define BAD_VALUE IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE
#define BUSY      IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE

static fake_port_t fake;
static impid_core_t core;
static uint16_t next_id;
static uint32_t acted[3]; /* calls, item and value of the last */

static bool act(void *context, uint8_t item, uint32_t value, uint32_t *answer) {
    TEST_ASSERT_EQUAL_PTR(&fake, context);
    acted[0]++;
    acted[1] = item;
    acted[2] = value;
    *answer = 11250u;
    return value < 100u;
}

static const impid_bench_port_t port = {&fake, act};

static void begin(const impid_bench_port_t *bench) {
    const impid_core_config_t config = {.bench = bench, .external_clock_hz = 8000123u};
    fake_port_init(&fake);
    impid_core_init(&core, &config, &fake.port);
    next_id = 1;
    acted[0] = 0;
}

void setUp(void) {
    begin(&port);
}

void tearDown(void) {
}

static void check(uint8_t opcode, uint8_t item, uint32_t value, uint8_t result, uint32_t answer) {
    fake_send_command(&core, IMPID_CARRIER_SERIAL, next_id++, opcode, item, value, fake.now_us);
    struct impid_messages_response_t response = fake_response(&fake);
    TEST_ASSERT_EQUAL_UINT8(result, response.result);
    TEST_ASSERT_EQUAL_UINT32(answer, response.value);
}

static void bin(uint32_t number, uint32_t count) {
    check(BENCH, HISTOGRAM_BIN, number, OK, count);
}

static void test_what_the_board_does_goes_to_the_board(void) {
    check(BENCH, EDGE, 17, OK, 11250);
    TEST_ASSERT_EQUAL_UINT32(1, acted[0]);
    TEST_ASSERT_EQUAL_UINT32(EDGE, acted[1]);
    TEST_ASSERT_EQUAL_UINT32(17, acted[2]);
    check(BENCH, EDGE, 100, BAD_VALUE, 0);
    check(INFO, IMPID_MESSAGES_COMMAND_ITEM_EXTERNAL_CLOCK_HZ_CHOICE, 0, OK, 8000123);
}

static void test_a_board_without_it_has_the_histogram_alone(void) {
    begin(NULL);
    check(BENCH, EDGE, 17, BAD_VALUE, 0);
    check(BENCH, HISTOGRAM, 5, OK, 0);
}

static void test_nothing_of_it_while_samples_are_taken(void) {
    check(START, 0, 0, OK, 0);
    check(BENCH, EDGE, 17, BUSY, 0);
    check(STOP, 0, 0, OK, 0);
    check(BENCH, EDGE, 17, OK, 11250);
    TEST_ASSERT_EQUAL_UINT32(1, acted[0]);
}

static void test_the_bus_is_not_taken_from_one_who_asks_over_it(void) {
    fake_send_command(&core, IMPID_CARRIER_CAN, 1, BENCH, CAN_LOOPBACK, 5, fake.now_us);
    fake_send_command(&core, IMPID_CARRIER_CAN, 2, BENCH, EDGE, 5, fake.now_us);
    TEST_ASSERT_EQUAL_UINT32(1, acted[0]);
    TEST_ASSERT_EQUAL_UINT32(EDGE, acted[1]);
    TEST_ASSERT_EQUAL_UINT8(BUSY, fake.can[0].data[3]);
    check(BENCH, CAN_LOOPBACK, 5, OK, 11250);
}

static void test_readings_of_one_axis_are_counted_by_code(void) {
    check(BENCH, HISTOGRAM, 1u << 16 | 20u, OK, 0);
    fake_period(&core, &fake, 1, 2000, 0);
    check(BENCH, HISTOGRAM_LEFT, 0, OK, 12);
    fake_period(&core, &fake, 1, 2003, 0);
    fake_period(&core, &fake, 1, 1990, 0); /* half of it is more than was asked for */
    check(BENCH, HISTOGRAM_LEFT, 0, OK, 0);
    check(BENCH, HISTOGRAM_BASE, 0, OK, 2000 - 32);
    bin(32, 8);
    bin(35, 8);
    bin(22, 4);
    bin(64, 0);
    check(BENCH, HISTOGRAM_BIN, 65, BAD_VALUE, 0);
}

static void test_readings_beyond_the_bins_are_counted_outside_at_both_ends_of_the_range(void) {
    check(BENCH, HISTOGRAM, 24u, OK, 0);
    fake_period(&core, &fake, 3, 0, 0);
    fake_period(&core, &fake, 0, 0, 0);
    fake_period(&core, &fake, 35, 0, 0);
    check(BENCH, HISTOGRAM_BASE, 0, OK, 0x10000u + 3u - 32u);
    bin(32, 8);
    bin(29, 8);
    bin(64, 8);
}

static void test_the_reference_is_counted_only_while_it_is_wanted(void) {
    TEST_ASSERT_FALSE(impid_core_wants_reference(&core));
    impid_core_reference(&core, 1500);
    check(BENCH, HISTOGRAM, 2u << 16 | 2u, OK, 0);
    TEST_ASSERT_TRUE(impid_core_wants_reference(&core));
    fake_period(&core, &fake, 9, 9, 0);
    impid_core_reference(&core, 1501);
    impid_core_reference(&core, 1502);
    TEST_ASSERT_FALSE(impid_core_wants_reference(&core));
    impid_core_reference(&core, 1503);
    bin(32, 1);
    bin(33, 1);
    bin(34, 0);
}

static void test_a_new_histogram_forgets_the_one_before(void) {
    check(BENCH, HISTOGRAM, 8, OK, 0);
    fake_period(&core, &fake, 100, 0, 0);
    check(BENCH, HISTOGRAM, 8, OK, 0);
    fake_period(&core, &fake, 500, 0, 0);
    bin(32, 8);
    check(BENCH, HISTOGRAM_BASE, 0, OK, 500 - 32);
}

static void test_what_cannot_be_counted_is_refused(void) {
    check(BENCH, HISTOGRAM, 0, BAD_VALUE, 0);
    check(BENCH, HISTOGRAM, 3u << 16 | 5u, BAD_VALUE, 0);
    TEST_ASSERT_FALSE(impid_histogram_begin(&core.bench.histogram, 0, 65536));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_what_the_board_does_goes_to_the_board);
    RUN_TEST(test_a_board_without_it_has_the_histogram_alone);
    RUN_TEST(test_nothing_of_it_while_samples_are_taken);
    RUN_TEST(test_the_bus_is_not_taken_from_one_who_asks_over_it);
    RUN_TEST(test_readings_of_one_axis_are_counted_by_code);
    RUN_TEST(test_readings_beyond_the_bins_are_counted_outside_at_both_ends_of_the_range);
    RUN_TEST(test_the_reference_is_counted_only_while_it_is_wanted);
    RUN_TEST(test_a_new_histogram_forgets_the_one_before);
    RUN_TEST(test_what_cannot_be_counted_is_refused);
    return UNITY_END();
}
