/* The settings' log on a flash of arbitrary content, through saves, power cuts, flipped bits and boots.
 *
 * The input: one byte of mode, an image of both sectors (blank where mode says so), then steps.
 * Must hold: no access outside the sectors; what a save reported as done is what the next boot finds; a
 * power cut leaves the values before it or those under way; and on a blank flash nothing ever refuses to work
 * again after prepare().
 */
#include "fuzz.h"

#include "impid_settings.h"

#include <string.h>

#define SECTOR_WORDS 150u /* room for three snapshots */
#define STEPS_MAX    200u
#define NO_CUT       UINT32_MAX

enum { STEP_SET, STEP_SAVE, STEP_BOOT, STEP_PREPARE, STEP_CUT, STEP_DAMAGE, STEPS };

static uint8_t chip[IMPID_SETTINGS_SECTORS][4u * SECTOR_WORDS];
static uint32_t bytes_until_cut; /* then the chip has no power until the next boot */

static bool powered(void) {
    if (bytes_until_cut == 0u) {
        return false;
    }
    bytes_until_cut -= bytes_until_cut != NO_CUT;
    return true;
}

static uint32_t chip_read(void *context, uint32_t sector, uint32_t word) {
    (void)context;
    FUZZ_CHECK(sector < IMPID_SETTINGS_SECTORS && word < SECTOR_WORDS);
    const uint8_t *bytes = &chip[sector][4u * word];
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static bool chip_program(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    (void)context;
    FUZZ_CHECK(sector < IMPID_SETTINGS_SECTORS && word < SECTOR_WORDS);
    for (uint32_t i = 0; i < 4u; i++) {
        if (!powered()) {
            return false;
        }
        chip[sector][4u * word + i] &= (uint8_t)(value >> (8u * i));
    }
    return true;
}

static bool chip_erase(void *context, uint32_t sector) {
    (void)context;
    FUZZ_CHECK(sector < IMPID_SETTINGS_SECTORS);
    for (uint32_t i = sizeof chip[sector]; i > 0u; i--) {
        if (!powered()) {
            return false;
        }
        chip[sector][i - 1u] = 0xFFu;
    }
    return true;
}

static const impid_flash_t flash = {NULL, SECTOR_WORDS, chip_read, chip_program, chip_erase};

typedef struct {
    impid_settings_t settings;
    uint32_t saved[IMPID_SETTINGS];     /* of the last save that reported success, or found at a boot */
    uint32_t under_way[IMPID_SETTINGS]; /* of a save that did not */
    bool maybe_under_way;
    bool damaged; /* bits were flipped: any earlier snapshot may be what stands */
} bench_t;

static void boot(bench_t *bench) {
    bytes_until_cut = NO_CUT;
    impid_settings_init(&bench->settings, &flash);
    const uint32_t *found = bench->settings.values;
    if (!bench->damaged) {
        FUZZ_CHECK(memcmp(found, bench->saved, sizeof bench->saved) == 0 ||
                   (bench->maybe_under_way && memcmp(found, bench->under_way, sizeof bench->saved) == 0));
    }
    memcpy(bench->saved, found, sizeof bench->saved);
    bench->maybe_under_way = false;
    bench->damaged = false;
}

static void save(bench_t *bench) {
    if (bench->settings.sequence == UINT32_MAX) {
        return; /* more saves than any flash bears; only a made-up image has it */
    }
    if (impid_settings_save(&bench->settings)) {
        memcpy(bench->saved, bench->settings.values, sizeof bench->saved);
        bench->maybe_under_way = false;
    } else if (!bench->maybe_under_way) {
        memcpy(bench->under_way, bench->settings.values, sizeof bench->under_way);
        bench->maybe_under_way = true;
    } else {
        /* the power has gone already: this save reached nothing */
    }
}

static void step(bench_t *bench, fuzz_input_t *input, bool was_blank) {
    uint32_t item;
    uint32_t value;
    switch (fuzz_take(input, 1) % STEPS) {
    case STEP_SET:
        item = fuzz_take(input, 1);
        value = fuzz_take(input, 4);
        if (impid_settings_set(&bench->settings, item, value)) {
            uint32_t now = 0;
            FUZZ_CHECK(impid_settings_get(&bench->settings, item, &now) && now == value);
        }
        break;
    case STEP_SAVE:
        save(bench);
        break;
    case STEP_BOOT:
        boot(bench);
        break;
    case STEP_PREPARE:
        if (impid_settings_prepare(&bench->settings) && was_blank && bytes_until_cut == NO_CUT) {
            save(bench);
            FUZZ_CHECK(!bench->maybe_under_way);
        }
        break;
    case STEP_CUT:
        bytes_until_cut = bytes_until_cut == NO_CUT ? fuzz_take(input, 1) : bytes_until_cut;
        break;
    default:
        value = fuzz_take(input, 2);
        chip[value % IMPID_SETTINGS_SECTORS][value / 2u % sizeof chip[0]] ^= (uint8_t)fuzz_take(input, 1);
        bench->damaged = true;
        break;
    }
    FUZZ_CHECK(bench->settings.sector < IMPID_SETTINGS_SECTORS);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static bench_t bench;
    fuzz_input_t input = {data, size};
    bool blank = (fuzz_take(&input, 1) & 1u) == 0u;
    memset(chip, 0xFF, sizeof chip);
    memset(&bench, 0, sizeof bench);
    for (uint32_t i = 0; !blank && i < sizeof chip && input.left > 0u; i++) {
        chip[i / sizeof chip[0]][i % sizeof chip[0]] = (uint8_t)fuzz_take(&input, 1);
    }
    bench.damaged = true; /* of the first boot nothing is known beforehand */
    boot(&bench);
    bool was_blank = blank;
    for (uint32_t i = 0; i < STEPS_MAX && input.left > 0u; i++) {
        step(&bench, &input, was_blank);
        was_blank = was_blank && !bench.damaged;
    }
    boot(&bench);
    return 0;
}
