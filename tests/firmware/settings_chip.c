#include "settings_chip.h"

#include <string.h>
#include <unity.h>

fake_flash_t chip;
impid_settings_t settings;

static void step(void) {
    if (chip.steps_left == 0u) {
        longjmp(chip.power_cut, 1);
    }
    if (chip.steps_left != NEVER) {
        chip.steps_left--;
    }
}

uint32_t chip_read(void *context, uint32_t sector, uint32_t word) {
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

bool chip_program(void *context, uint32_t sector, uint32_t word, uint32_t value) {
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
bool chip_erase(void *context, uint32_t sector) {
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

void chip_new(void) {
    memset(&chip, 0xFF, sizeof chip.bytes);
    chip.steps_left = NEVER;
    chip.operations_left = NEVER;
    chip.erases = 0;
    boot();
}

void boot(void) {
    impid_settings_init(&settings, &flash);
}

uint32_t value_of(uint32_t item) {
    uint32_t value = 0;
    TEST_ASSERT_TRUE(impid_settings_get(&settings, item, &value));
    return value;
}

void count_one_boot(void) {
    boot();
    (void)impid_settings_prepare(&settings);
    (void)impid_settings_count_boot(&settings);
}

bool with_power_for(uint32_t steps, void (*run)(void)) {
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
