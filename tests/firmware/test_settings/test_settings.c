/* What the settings keep, how they refuse, and the commands that reach them. */
#include "fake_port.h"
#include "settings_chip.h"

#include <string.h>
#include <unity.h>

void setUp(void) {
    chip_new();
}

void tearDown(void) {
}

static void test_an_empty_flash_gives_the_defaults(void) {
    TEST_ASSERT_EQUAL_UINT32(0, value_of(IMPID_SETTING_BOOT_COUNT));
    TEST_ASSERT_EQUAL_UINT32(1000, value_of(IMPID_SETTING_CAN_KBPS));
    TEST_ASSERT_EQUAL_UINT32(32768, value_of(IMPID_SETTING_ACCEL_X_ZERO));
    TEST_ASSERT_EQUAL_UINT32(32768, value_of(IMPID_SETTING_ACCEL_Y_ZERO));
    /* ADXL203 data sheet: 560 mV/g at 3 V; 65536 codes for the supply */
    TEST_ASSERT_UINT32_WITHIN(1, 12233, value_of(IMPID_SETTING_ACCEL_X_PER_G));
    TEST_ASSERT_EQUAL_UINT32(0, value_of(IMPID_SETTING_ENCODER_2_CPR));
}

static void test_flash_full_of_anything_gives_the_defaults_and_recovers(void) {
    for (uint32_t i = 0; i < sizeof chip.bytes; i++) {
        chip.bytes[i / SECTOR_BYTES][i % SECTOR_BYTES] = (uint8_t)(i * 37u + 11u);
    }
    boot();
    TEST_ASSERT_EQUAL_UINT32(1000, value_of(IMPID_SETTING_CAN_KBPS));
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    boot();
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
}

static void test_only_saved_values_outlive_a_boot(void) {
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 500));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_ACCEL_Y_ZERO, 65535));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_ENCODER_1_CPR, 0xFFFFFFFFu));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_ACCEL_X_ANGLE, (uint32_t)-1234));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_ACCEL_Y_ANGLE_INTERVAL, 87));
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 250));
    TEST_ASSERT_EQUAL_UINT32(250, value_of(IMPID_SETTING_CAN_KBPS));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 1000));
    boot();
    TEST_ASSERT_EQUAL_UINT32(500, value_of(IMPID_SETTING_CAN_KBPS));
    TEST_ASSERT_EQUAL_UINT32(65535, value_of(IMPID_SETTING_ACCEL_Y_ZERO));
    TEST_ASSERT_EQUAL_UINT32(0xFFFFFFFFu, value_of(IMPID_SETTING_ENCODER_1_CPR));
    TEST_ASSERT_EQUAL_INT32(-1234, (int32_t)value_of(IMPID_SETTING_ACCEL_X_ANGLE));
    TEST_ASSERT_EQUAL_UINT32(87, value_of(IMPID_SETTING_ACCEL_Y_ANGLE_INTERVAL));
}

static void test_values_out_of_range_change_nothing(void) {
    const uint32_t refused[][2] = {{IMPID_SETTING_BOOT_COUNT, 0},         {IMPID_SETTING_BOOT_COUNT, 5},
                                   {IMPID_SETTING_CAN_KBPS, 0},           {IMPID_SETTING_CAN_KBPS, 249},
                                   {IMPID_SETTING_CAN_KBPS, 800},         {IMPID_SETTING_CAN_KBPS, 1001},
                                   {IMPID_SETTING_ACCEL_X_ZERO, 65536},   {IMPID_SETTING_ACCEL_X_PER_G, 999},
                                   {IMPID_SETTING_ACCEL_Y_PER_G, 60001u}, {IMPID_SETTINGS, 0}};
    for (uint32_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        impid_settings_t before = settings;
        TEST_ASSERT_FALSE(impid_settings_set(&settings, refused[i][0], refused[i][1]));
        TEST_ASSERT_EQUAL_MEMORY(&before, &settings, sizeof before);
    }
    uint32_t value;
    TEST_ASSERT_FALSE(impid_settings_get(&settings, IMPID_SETTINGS, &value));
    TEST_ASSERT_FALSE(impid_settings_get(&settings, 0xFFFFFFFFu, &value));
}

static void test_every_boot_is_counted_through_many_erases(void) {
    for (uint32_t i = 1; i <= 100u; i++) {
        boot();
        TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
        TEST_ASSERT_EQUAL_UINT32(i, impid_settings_count_boot(&settings));
    }
    /* Three snapshots a sector: one erase every three boots, and one or two at first. */
    TEST_ASSERT_UINT32_WITHIN(2, 100u / 3u, chip.erases);
}

static void test_save_never_erases_and_says_when_it_is_full(void) {
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    uint32_t erases = chip.erases;
    for (uint32_t i = 0; i < 6u; i++) {
        TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_ENCODER_1_CPR, i));
        TEST_ASSERT_TRUE(impid_settings_save(&settings));
    }
    TEST_ASSERT_FALSE(impid_settings_save(&settings));
    TEST_ASSERT_EQUAL_UINT32(erases, chip.erases);
    boot();
    TEST_ASSERT_EQUAL_UINT32(5, value_of(IMPID_SETTING_ENCODER_1_CPR));
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
}

static void test_a_flash_that_refuses_is_reported_and_loses_nothing(void) {
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 500));
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 250));
    chip.operations_left = 0;
    TEST_ASSERT_FALSE(impid_settings_save(&settings));
    memset(chip.bytes[1], 0x55, SECTOR_BYTES);
    TEST_ASSERT_FALSE(impid_settings_prepare(&settings));
    chip.operations_left = NEVER;
    boot();
    TEST_ASSERT_EQUAL_UINT32(500, value_of(IMPID_SETTING_CAN_KBPS));
}

static void test_a_flash_that_refuses_at_any_operation_of_the_first_boot_is_reported(void) {
    /* Both sectors: mark cleared, erased, mark written. */
    for (uint32_t operations = 0; operations < 6u; operations++) {
        setUp();
        chip.operations_left = operations;
        TEST_ASSERT_FALSE(impid_settings_prepare(&settings));
    }
    setUp();
    chip.operations_left = 6;
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
}

static void test_a_word_that_does_not_read_back_is_not_saved(void) {
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    chip.bytes[settings.sector][8] = 0x00; /* a worn cell where the sequence, 1, goes next */
    TEST_ASSERT_FALSE(impid_settings_save(&settings));
    TEST_ASSERT_TRUE(impid_settings_save(&settings)); /* the place after it serves */
}

/* Runs with the power going after `steps` bytes, then restores it and boots. true: it ran to its end. */
static fake_port_t fake;
static impid_core_t core;
static uint16_t next_id;

static struct impid_messages_response_t ask(uint8_t opcode, uint8_t item, uint32_t value) {
    fake_send_command(&core, IMPID_CARRIER_SERIAL, next_id++, opcode, item, value, fake.now_us);
    return fake_response(&fake);
}

static void check(struct impid_messages_response_t response, uint8_t result, uint32_t value) {
    TEST_ASSERT_EQUAL_UINT8(result, response.result);
    TEST_ASSERT_EQUAL_UINT32(value, response.value);
}

#define GET        IMPID_MESSAGES_COMMAND_OPCODE_GET_CHOICE
#define SET        IMPID_MESSAGES_COMMAND_OPCODE_SET_CHOICE
#define SAVE       IMPID_MESSAGES_COMMAND_OPCODE_SAVE_CHOICE
#define LOG        IMPID_MESSAGES_COMMAND_OPCODE_LOG_CHOICE
#define OK         IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE
#define BAD_ITEM   IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE
#define BAD_VALUE  IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE
#define FAILED     IMPID_MESSAGES_RESPONSE_RESULT_FAILED_CHOICE
#define CAN_KBPS   IMPID_MESSAGES_COMMAND_ITEM_CAN_KBPS_CHOICE
#define BOOT_COUNT IMPID_MESSAGES_COMMAND_ITEM_BOOT_COUNT_CHOICE
#define LAST       IMPID_MESSAGES_COMMAND_ITEM_SYNC_PULL_CHOICE

static void test_commands_read_change_and_keep_settings(void) {
    static const uint32_t log_words[] = {3, 0xDEADBEEFu};
    const impid_core_config_t config = {.settings = &settings, .log = log_words, .log_words = 2};
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    (void)impid_settings_count_boot(&settings);
    fake_port_init(&fake);
    impid_core_init(&core, &config, &fake.port);
    next_id = 1;

    check(ask(GET, BOOT_COUNT, 0), OK, 1);
    check(ask(SET, BOOT_COUNT, 7), BAD_VALUE, 0);
    check(ask(GET, BOOT_COUNT - 1, 0), BAD_ITEM, 0);
    check(ask(GET, LAST + 1, 0), BAD_ITEM, 0);
    check(ask(SET, LAST + 1, 0), BAD_ITEM, 0);
    check(ask(SET, CAN_KBPS, 125), BAD_VALUE, 0);
    check(ask(SET, CAN_KBPS, 250), OK, 250);
    check(ask(SAVE, 0, 0), OK, 0);
    check(ask(SET, LAST, 0), OK, 0);
    check(ask(GET, LAST, 0), OK, 0);
    chip.operations_left = 0;
    check(ask(SAVE, 0, 0), FAILED, 0);
    chip.operations_left = NEVER;
    check(ask(LOG, IMPID_MESSAGES_COMMAND_ITEM_FAULT_COUNT_CHOICE, 0), OK, 3);
    check(ask(LOG, IMPID_MESSAGES_COMMAND_ITEM_FAULT_KIND_CHOICE, 0), OK, 0xDEADBEEFu);
    check(ask(LOG, IMPID_MESSAGES_COMMAND_ITEM_FAULT_PC_CHOICE, 0), BAD_ITEM, 0);
    check(ask(LOG, 0, 0), BAD_ITEM, 0);

    boot();
    TEST_ASSERT_EQUAL_UINT32(250, value_of(IMPID_SETTING_CAN_KBPS));
    TEST_ASSERT_EQUAL_UINT32(1, value_of(IMPID_SETTING_SYNC_PULL));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_an_empty_flash_gives_the_defaults);
    RUN_TEST(test_flash_full_of_anything_gives_the_defaults_and_recovers);
    RUN_TEST(test_only_saved_values_outlive_a_boot);
    RUN_TEST(test_values_out_of_range_change_nothing);
    RUN_TEST(test_every_boot_is_counted_through_many_erases);
    RUN_TEST(test_save_never_erases_and_says_when_it_is_full);
    RUN_TEST(test_a_flash_that_refuses_is_reported_and_loses_nothing);
    RUN_TEST(test_a_flash_that_refuses_at_any_operation_of_the_first_boot_is_reported);
    RUN_TEST(test_a_word_that_does_not_read_back_is_not_saved);
    RUN_TEST(test_commands_read_change_and_keep_settings);
    return UNITY_END();
}
