#include "fake_port.h"

#include <unity.h>

static fake_port_t fake;
static impid_core_t core;

/* At 3.3 V the data sheet's 400..1100 mV become 115..316 mV (cube of the supply), typically 216 mV. */
static uint16_t codes(uint16_t millivolts) {
    return (uint16_t)(millivolts * 4096u / 3300u);
}

void setUp(void) {
    const impid_core_config_t config = {.first_index = 0, .boot_us = 0};
    fake_port_init(&fake);
    impid_core_init(&core, &config, &fake.port);
}

void tearDown(void) {
}

/* Runs a self-test with an accelerometer that answers the pin by so much; returns the verdict. */
static uint8_t verdict(uint16_t x_mV, uint16_t y_mV) {
    fake_send_command(&core, IMPID_CARRIER_SERIAL, 1, IMPID_MESSAGES_COMMAND_OPCODE_SELF_TEST_CHOICE, 0, 0,
                      0);
    TEST_ASSERT_EQUAL_UINT8(0, fake_response(&fake).result);
    uint32_t driven = 0;
    for (uint32_t i = 0; i < 500u; i++) {
        uint16_t rise_x = codes(fake.pin ? x_mV : 0u);
        uint16_t rise_y = codes(fake.pin ? y_mV : 0u);
        driven += fake.pin;
        fake_period(&core, &fake, (uint16_t)(2000u + rise_x), (uint16_t)(2100u + rise_y), 0);
    }
    TEST_ASSERT_FALSE(fake.pin);
    TEST_ASSERT_EQUAL_UINT32(IMPID_SELFTEST_MEAN_SAMPLES + IMPID_SELFTEST_SETTLE_SAMPLES, driven);
    struct impid_messages_status_health_t health;
    const uint8_t *status = fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE);
    (void)impid_messages_status_health_unpack(&health, &status[40], 8);
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_STATE_IDLE_CHOICE, health.state);
    return health.self_test;
}

static void test_typical_response_passes_and_is_reported(void) {
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE, verdict(216, 230));
    fake_send_command(&core, IMPID_CARRIER_SERIAL, 2, IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE,
                      IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_X_MV_CHOICE, 0, 0);
    TEST_ASSERT_INT32_WITHIN(1, 216, (int32_t)fake_response(&fake).value);
    fake_send_command(&core, IMPID_CARRIER_SERIAL, 3, IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE,
                      IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_Y_MV_CHOICE, 0, 0);
    TEST_ASSERT_INT32_WITHIN(1, 230, (int32_t)fake_response(&fake).value);
}

static void test_limits_of_the_data_sheet(void) {
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE, verdict(118, 314));
}

static void test_too_little_on_x(void) {
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_X_CHOICE, verdict(112, 216));
}

static void test_too_much_on_y(void) {
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Y_CHOICE, verdict(216, 320));
}

static void test_limits_and_response_go_with_the_supply_of_the_moment(void) {
    /* 149..410 mV by the cube, and a code is 3600 / 3300 of what it was: 330 becomes 360, which 3.3 V
     * refuses. */
    fake.supply_mV = 3600;
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE, verdict(330, 330));
    TEST_ASSERT_INT32_WITHIN(1, 360, core.selftest.response_m[0]);
}

static void test_a_dead_sensor(void) {
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_BOTH_CHOICE, verdict(0, 0));
}

static void test_nothing_of_it_reaches_a_stream_or_its_counters(void) {
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE, verdict(216, 216));
    TEST_ASSERT_EQUAL_UINT32(0, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(0, core.sampler.produced);
    fake_send_command(&core, IMPID_CARRIER_SERIAL, 4, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 0, 0, 0);
    for (uint32_t i = 0; i < 10u; i++) {
        fake_period(&core, &fake, 2000, 2100, 0);
    }
    struct impid_messages_accel_t accel;
    (void)impid_messages_accel_unpack(&accel,
                                      fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE), 8);
    TEST_ASSERT_EQUAL_UINT16(32000, accel.ax);
    TEST_ASSERT_EQUAL_HEX8(IMPID_FLAG_RESET, accel.flags);
}

static void test_samples_outside_a_self_test_are_none_of_its_business(void) {
    impid_selftest_t idle;
    impid_selftest_init(&idle, &impid_adxl203);
    impid_sample_t sample = {.accel = {65535, 65535}};
    for (uint32_t i = 0; i < 1000u; i++) {
        TEST_ASSERT_FALSE(impid_selftest_sample(&idle, &sample, &fake.port));
    }
    TEST_ASSERT_FALSE(fake.pin);
    TEST_ASSERT_FALSE(impid_selftest_running(&idle));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_NOT_RUN_CHOICE, idle.verdict);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_typical_response_passes_and_is_reported);
    RUN_TEST(test_limits_of_the_data_sheet);
    RUN_TEST(test_too_little_on_x);
    RUN_TEST(test_too_much_on_y);
    RUN_TEST(test_limits_and_response_go_with_the_supply_of_the_moment);
    RUN_TEST(test_a_dead_sensor);
    RUN_TEST(test_nothing_of_it_reaches_a_stream_or_its_counters);
    RUN_TEST(test_samples_outside_a_self_test_are_none_of_its_business);
    return UNITY_END();
}
