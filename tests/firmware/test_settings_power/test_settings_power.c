/* The power goes at any byte: the old values or the new ones stand, and the next boot works on. */
#include "settings_chip.h"

#include <unity.h>

void setUp(void) {
    chip_new();
}

void tearDown(void) {
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
    chip_new();
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

static void count_twelve_boots(void) {
    for (uint32_t i = 0; i < 12u; i++) {
        count_one_boot();
    }
}

static void test_a_second_cut_during_the_recovery_is_survived_too(void) {
    for (uint32_t first = 0; first < 1400u; first += 7u) {
        chip_new();
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

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_power_cut_at_any_byte_leaves_the_old_or_the_new);
    RUN_TEST(test_a_second_cut_during_the_recovery_is_survived_too);
    return UNITY_END();
}
