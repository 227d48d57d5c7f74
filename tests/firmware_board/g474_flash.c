/* The second chip's flash driver under the core's settings log and updates; run by test_g474_flash.py on the
 * chip's processor with a model of its flash. */
#include "flash.h"
#include "impid_assert.h"
#include "impid_crc32.h"
#include "impid_settings.h"
#include "impid_update.h"
#include "slots.h"

#include <string.h>

/* In and out: what the test asks for and learns. */
volatile uint32_t asked[4];
volatile uint32_t told[8];

static impid_settings_t settings;

/* An undefined instruction, which ends the run with an error. */
_Noreturn void impid_assert_failed(const char *what) {
    (void)what;
    __builtin_trap();
}

static void start_settings(void) {
    impid_settings_init(&settings, &flash_settings);
    told[0] += impid_settings_prepare(&settings) ? 0u : 1u;
}

/* asked[0] saves, the count of each being the setting's value; a boot before each tenth. */
void save_often(void) {
    start_settings();
    for (uint32_t i = 0; i < asked[0]; i++) {
        if (i % 10u == 0u) {
            start_settings();
        }
        (void)impid_settings_set(&settings, IMPID_SETTING_ENCODER_1_CPR, 1000u + i);
        told[0] += impid_settings_save(&settings) ? 0u : 1u;
    }
    start_settings();
    (void)impid_settings_get(&settings, IMPID_SETTING_ENCODER_1_CPR, (uint32_t *)&told[1]);
}

static uint32_t image_word(uint32_t n) {
    return n == 1u ? SLOT_1_BASE + 4u * IMPID_SLOT_IMAGE + 9u : n * 2654435761u;
}

static uint32_t read_slot_word(void *context, uint32_t slot, uint32_t word) {
    (void)context;
    return *slot_word(slot, word);
}

/* An image of asked[0] words into slot 1, slot 0 being the running one. */
void update(void) {
    const impid_update_port_t port = {
        .flash = &flash_slots, .base = {SLOT_0_BASE, SLOT_1_BASE}, .running = 0u};
    static impid_update_t state;
    impid_update_init(&state, &port);
    uint32_t words = asked[0];
    told[0] = impid_update_begin(&state, 4u * words);
    uint32_t crc = UINT32_MAX;
    for (uint32_t n = 0; n < words; n++) {
        told[1] += impid_update_write(&state, (uint8_t)n, image_word(n)) != IMPID_UPDATE_OK;
        crc = impid_slots_crc_word(crc, image_word(n));
    }
    told[2] = impid_update_finish(&state, ~crc);
    /* What a boot finds, which has only the flash. */
    told[3] = impid_slots_whole(read_slot_word, NULL, 1u);
    told[4] = impid_slots_choose(read_slot_word, NULL);
    const impid_update_port_t next = {
        .flash = &flash_slots, .base = {SLOT_0_BASE, SLOT_1_BASE}, .running = 1u};
    impid_update_init(&state, &next);
    told[5] = impid_update_confirmed(&state);
    told[6] = impid_update_confirm(&state);
    told[7] = impid_update_confirmed(&state);
}
