/* Settings that another firmware left behind: of earlier layouts, and of a later one of ours. */
#include "earlier_layouts.h"
#include "settings_chip.h"

#include <string.h>
#include <unity.h>

void setUp(void) {
    chip_new();
}

void tearDown(void) {
}

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
    chip_new();
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

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_every_earlier_layout_is_read_and_goes_on);
    RUN_TEST(test_a_power_cut_at_any_byte_of_a_migration_loses_nothing);
    RUN_TEST(test_values_that_only_a_later_firmware_knows_are_kept);
    RUN_TEST(test_a_value_that_a_snapshot_does_not_hold_gets_its_default);
    return UNITY_END();
}
