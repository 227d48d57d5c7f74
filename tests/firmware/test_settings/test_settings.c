/* Settings on a flash that obeys the rules of the real one (erase sets all bits of a sector, programming only
 * clears bits) and whose power can be cut after any byte written or at any point of an erase. */
#include "earlier_layouts.h"
#include "fake_port.h"
#include "impid_settings.h"

#include <setjmp.h>
#include <string.h>
#include <unity.h>

#define SECTOR_WORDS 150u /* room for three snapshots: the sectors change often */
#define SECTOR_BYTES (4u * SECTOR_WORDS)
#define NEVER        0xFFFFFFFFu

typedef struct {
    uint8_t bytes[2][SECTOR_BYTES];
    uint32_t steps_left; /* bytes programmed or erased until the power goes */
    jmp_buf power_cut;
    uint32_t operations_left; /* programs and erases until flash refuses */
    uint32_t erases;
} fake_flash_t;

static fake_flash_t chip;
static impid_settings_t settings;

static void step(void) {
    if (chip.steps_left == 0u) {
        longjmp(chip.power_cut, 1);
    }
    if (chip.steps_left != NEVER) {
        chip.steps_left--;
    }
}

static uint32_t chip_read(void *context, uint32_t sector, uint32_t word) {
    const fake_flash_t *flash = context;
    const uint8_t *bytes = &flash->bytes[sector][4u * word];
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) |
           ((uint32_t)bytes[3] << 24);
}

static bool refuses(fake_flash_t *flash) {
    if (flash->operations_left == 0u) {
        return true;
    }
    if (flash->operations_left != NEVER) {
        flash->operations_left--;
    }
    return false;
}

static bool chip_program(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    fake_flash_t *flash = context;
    if (refuses(flash)) {
        return false;
    }
    for (uint32_t i = 0; i < 4u; i++) {
        step();
        uint8_t *byte = &flash->bytes[sector][4u * word + i];
        *byte = (uint8_t)(*byte & (value >> (8u * i)));
    }
    return true;
}

/* Backwards, so that a cut leaves the mark standing over a half-erased sector: the worse order. */
static bool chip_erase(void *context, uint32_t sector) {
    fake_flash_t *flash = context;
    if (refuses(flash)) {
        return false;
    }
    flash->erases++;
    for (uint32_t i = SECTOR_BYTES; i > 0u; i--) {
        step();
        flash->bytes[sector][i - 1u] = 0xFFu;
    }
    return true;
}

static const impid_flash_t flash = {.context = &chip,
                                    .sector_words = SECTOR_WORDS,
                                    .read = chip_read,
                                    .program = chip_program,
                                    .erase = chip_erase};

static uint32_t value_of(uint32_t item) {
    uint32_t value = 0;
    TEST_ASSERT_TRUE(impid_settings_get(&settings, item, &value));
    return value;
}

static void boot(void) {
    impid_settings_init(&settings, &flash);
}

void setUp(void) {
    memset(&chip, 0xFF, sizeof chip.bytes);
    chip.steps_left = NEVER;
    chip.operations_left = NEVER;
    chip.erases = 0;
    boot();
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
static bool with_power_for(uint32_t steps, void (*run)(void)) {
    static volatile bool finished; /* survives longjmp, as every static does */
    finished = false;
    chip.steps_left = steps;
    if (setjmp(chip.power_cut) == 0) {
        run();
        finished = true;
    }
    chip.steps_left = NEVER;
    boot();
    return finished;
}

static uint32_t saved;     /* the last save that returned */
static uint32_t under_way; /* the last one begun */

static void boot_and_save_twelve_times(void) {
    for (uint32_t i = 1; i <= 12u; i++) {
        boot();
        (void)impid_settings_prepare(&settings);
        (void)impid_settings_set(&settings, IMPID_SETTING_ENCODER_1_CPR, i);
        (void)impid_settings_set(&settings, IMPID_SETTING_ENCODER_2_CPR, ~i);
        under_way = i;
        (void)impid_settings_save(&settings);
        saved = i;
    }
}

static bool survive_cut_after(uint32_t steps) {
    setUp();
    saved = 0;
    under_way = 0;
    bool finished = with_power_for(steps, boot_and_save_twelve_times);
    uint32_t found = value_of(IMPID_SETTING_ENCODER_1_CPR);
    TEST_ASSERT_TRUE_MESSAGE(found == saved || found == under_way, "neither the old nor the new values");
    /* All of one snapshot: never a mixture. */
    TEST_ASSERT_EQUAL_UINT32(found == 0u ? 0u : ~found, value_of(IMPID_SETTING_ENCODER_2_CPR));
    /* And the store works on: saving and finding again. */
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 250));
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
    boot();
    TEST_ASSERT_EQUAL_UINT32(250, value_of(IMPID_SETTING_CAN_KBPS));
    TEST_ASSERT_EQUAL_UINT32(found, value_of(IMPID_SETTING_ENCODER_1_CPR));
    return finished;
}

static void test_a_power_cut_at_any_byte_leaves_the_old_or_the_new(void) {
    uint32_t cuts = 0;
    while (!survive_cut_after(cuts)) {
        cuts++;
    }
    /* 12 saves of at least 44 bytes and at least three erases lie within. */
    TEST_ASSERT_GREATER_THAN_UINT32(12u * 44u + 3u * SECTOR_BYTES, cuts);
}

static void count_one_boot(void) {
    boot();
    (void)impid_settings_prepare(&settings);
    (void)impid_settings_count_boot(&settings);
}

static void count_twelve_boots(void) {
    for (uint32_t i = 0; i < 12u; i++) {
        count_one_boot();
    }
}

static void test_a_second_cut_during_the_recovery_is_survived_too(void) {
    for (uint32_t first = 0; first < 1400u; first += 7u) {
        setUp();
        (void)with_power_for(first, count_twelve_boots);
        uint32_t before = value_of(IMPID_SETTING_BOOT_COUNT);
        for (uint32_t second = 1; second < 300u; second += 23u) {
            (void)with_power_for(second, count_one_boot);
            uint32_t now = value_of(IMPID_SETTING_BOOT_COUNT);
            TEST_ASSERT_TRUE(now == before || now == before + 1u);
            before = now;
        }
    }
}

/* --- Other firmware's settings --------------------------------------------------------------------- */

typedef struct {
    const uint32_t *words[2];
    uint32_t counts[2];
    uint32_t values; /* that the layout holds */
    uint32_t boots;
} earlier_t;

#define WORDS(array) (sizeof(array) / sizeof((array)[0]))

static const earlier_t earlier[] = {
    {{layout_1_sector_0, layout_1_sector_1},
     {WORDS(layout_1_sector_0), WORDS(layout_1_sector_1)},
     8,
     LAYOUT_1_BOOTS},
    {{layout_2_sector_0, layout_2_sector_1},
     {WORDS(layout_2_sector_0), WORDS(layout_2_sector_1)},
     16,
     LAYOUT_2_BOOTS},
};

static void lay(const earlier_t *left) {
    setUp();
    for (uint32_t sector = 0; sector < 2u; sector++) {
        for (uint32_t word = 0; word < left->counts[sector]; word++) {
            TEST_ASSERT_TRUE(chip_program(&chip, sector, word, left->words[sector][word]));
        }
    }
    boot();
}

/* What the earlier firmware was told to keep. */
static uint32_t told(uint32_t item) {
    if (item == IMPID_SETTING_CAN_KBPS) {
        return 500;
    }
    return item < 4u ? 32100u + item : item < 6u ? 12000u + item : 1000u + item;
}

static void check_values(const earlier_t *left) {
    for (uint32_t item = 1; item < left->values; item++) {
        TEST_ASSERT_EQUAL_UINT32(told(item), value_of(item));
    }
    for (uint32_t item = left->values; item < IMPID_SETTINGS; item++) {
        impid_settings_t fresh;
        static fake_flash_t empty;
        memset(&empty, 0xFF, sizeof empty.bytes);
        const impid_flash_t nothing = {&empty, SECTOR_WORDS, chip_read, chip_program, chip_erase};
        impid_settings_init(&fresh, &nothing);
        TEST_ASSERT_EQUAL_UINT32(fresh.values[item], value_of(item));
    }
}

static void test_every_earlier_layout_is_read_and_goes_on(void) {
    for (uint32_t i = 0; i < WORDS(earlier); i++) {
        lay(&earlier[i]);
        check_values(&earlier[i]);
        TEST_ASSERT_EQUAL_UINT32(earlier[i].boots, value_of(IMPID_SETTING_BOOT_COUNT));
        for (uint32_t n = 1; n < 30u; n++) {
            boot();
            TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
            TEST_ASSERT_EQUAL_UINT32(earlier[i].boots + n, impid_settings_count_boot(&settings));
        }
        boot();
        check_values(&earlier[i]);
    }
}

static void test_a_power_cut_at_any_byte_of_a_migration_loses_nothing(void) {
    for (uint32_t i = 0; i < WORDS(earlier); i++) {
        uint32_t cuts = 0;
        bool finished = false;
        while (!finished) {
            lay(&earlier[i]);
            finished = with_power_for(cuts, count_one_boot);
            uint32_t count = value_of(IMPID_SETTING_BOOT_COUNT);
            TEST_ASSERT_EQUAL_UINT32(earlier[i].boots + (finished ? 1u : 0u), count);
            check_values(&earlier[i]);
            count_one_boot();
            boot();
            TEST_ASSERT_EQUAL_UINT32(count + 1u, value_of(IMPID_SETTING_BOOT_COUNT));
            check_values(&earlier[i]);
            cuts++;
        }
        /* The erase of the other sector and a snapshot. */
        TEST_ASSERT_GREATER_THAN_UINT32(SECTOR_BYTES, cuts);
    }
}

/* As a firmware of the time to come would write it: three values more than this one knows. */
static void test_values_that_only_a_later_firmware_knows_are_kept(void) {
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    TEST_ASSERT_TRUE(impid_settings_set(&settings, IMPID_SETTING_CAN_KBPS, 500));
    settings.count = (uint32_t)IMPID_SETTINGS + 3u;
    for (uint32_t i = 0; i < 3u; i++) {
        settings.values[(uint32_t)IMPID_SETTINGS + i] = 77u + i;
    }
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
    for (uint32_t n = 0; n < 12u; n++) {
        count_one_boot();
    }
    boot();
    TEST_ASSERT_EQUAL_UINT32(500, value_of(IMPID_SETTING_CAN_KBPS));
    uint32_t value;
    TEST_ASSERT_FALSE(impid_settings_get(&settings, IMPID_SETTINGS, &value));
    TEST_ASSERT_EQUAL_UINT32((uint32_t)IMPID_SETTINGS + 3u, settings.count);
    for (uint32_t i = 0; i < 3u; i++) {
        TEST_ASSERT_EQUAL_UINT32(77u + i, settings.values[(uint32_t)IMPID_SETTINGS + i]);
    }
}

/* And as an earlier one of this layout would: a value fewer. */
static void test_a_value_that_a_snapshot_does_not_hold_gets_its_default(void) {
    TEST_ASSERT_TRUE(impid_settings_prepare(&settings));
    uint32_t last = (uint32_t)IMPID_SETTINGS - 1u;
    uint32_t initial = value_of(last);
    settings.values[last] = ~initial;
    settings.count = last;
    TEST_ASSERT_TRUE(impid_settings_save(&settings));
    boot();
    TEST_ASSERT_EQUAL_UINT32(initial, value_of(last));
    TEST_ASSERT_EQUAL_UINT32(IMPID_SETTINGS, settings.count);
}

/* --- The commands -------------------------------------------------------------------------------- */

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
    RUN_TEST(test_a_power_cut_at_any_byte_leaves_the_old_or_the_new);
    RUN_TEST(test_a_second_cut_during_the_recovery_is_survived_too);
    RUN_TEST(test_every_earlier_layout_is_read_and_goes_on);
    RUN_TEST(test_a_power_cut_at_any_byte_of_a_migration_loses_nothing);
    RUN_TEST(test_values_that_only_a_later_firmware_knows_are_kept);
    RUN_TEST(test_a_value_that_a_snapshot_does_not_hold_gets_its_default);
    RUN_TEST(test_commands_read_change_and_keep_settings);
    return UNITY_END();
}
