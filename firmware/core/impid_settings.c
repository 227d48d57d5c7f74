#include "impid_settings.h"

#include "impid_crc32.h"

#define ERASED_WORD    0xFFFFFFFFu
#define MARK           0x494D5031u /* "1PMI" in memory */
#define LAYOUT         2u
#define SNAPSHOT_WORDS ((uint32_t)IMPID_SETTINGS + 3u)
#define CRC_WORD       (SNAPSHOT_WORDS - 1u)

typedef struct {
    uint32_t initial;
    uint32_t low;
    uint32_t high;
} range_t;

static const range_t ranges[IMPID_SETTINGS] = {
    [IMPID_SETTING_BOOT_COUNT] = {0u, 1u, 0u}, /* no value may be set */
    [IMPID_SETTING_CAN_KBPS] = {1000u, 250u, 1000u},
    [IMPID_SETTING_ACCEL_X_ZERO] = {32768u, 0u, 65535u}, /* half the supply */
    [IMPID_SETTING_ACCEL_Y_ZERO] = {32768u, 0u, 65535u},
    /* 560 mV/g at 3 V (ADXL203 data sheet), ratiometric: 65536 * 0.56 / 3 */
    [IMPID_SETTING_ACCEL_X_PER_G] = {12233u, 1000u, 60000u},
    [IMPID_SETTING_ACCEL_Y_PER_G] = {12233u, 1000u, 60000u},
    [IMPID_SETTING_ENCODER_1_CPR] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ENCODER_2_CPR] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_X_ANGLE] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_Y_ANGLE] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_X_ZERO_INTERVAL] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_Y_ZERO_INTERVAL] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_X_PER_G_INTERVAL] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_Y_PER_G_INTERVAL] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_X_ANGLE_INTERVAL] = {0u, 0u, UINT32_MAX},
    [IMPID_SETTING_ACCEL_Y_ANGLE_INTERVAL] = {0u, 0u, UINT32_MAX},
};

static uint32_t read(const impid_settings_t *settings, uint32_t sector, uint32_t word) {
    return settings->flash->read(settings->flash->context, sector, word);
}

static bool program(const impid_settings_t *settings, uint32_t sector, uint32_t word, uint32_t value) {
    return settings->flash->program(settings->flash->context, sector, word, value);
}

/* Snapshots that a sector has room for behind its mark. */
static uint32_t places(const impid_settings_t *settings) {
    return (settings->flash->sector_words - 1u) / SNAPSHOT_WORDS;
}

static uint32_t first_word(uint32_t place) {
    return 1u + place * SNAPSHOT_WORDS;
}

static bool blank(const impid_settings_t *settings, uint32_t sector, uint32_t from, uint32_t to) {
    for (uint32_t word = from; word < to; word++) {
        if (read(settings, sector, word) != ERASED_WORD) {
            return false;
        }
    }
    return true;
}

static bool place_blank(const impid_settings_t *settings, uint32_t sector, uint32_t place) {
    return blank(settings, sector, first_word(place), first_word(place + 1u));
}

static uint32_t crc_of(const uint32_t words[SNAPSHOT_WORDS]) {
    uint8_t bytes[4u * CRC_WORD];
    for (uint32_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)(words[i / 4u] >> (8u * (i % 4u)));
    }
    return impid_crc32(bytes, sizeof bytes);
}

static bool load(const impid_settings_t *settings, uint32_t sector, uint32_t place,
                 uint32_t words[SNAPSHOT_WORDS]) {
    for (uint32_t i = 0; i < SNAPSHOT_WORDS; i++) {
        words[i] = read(settings, sector, first_word(place) + i);
    }
    return words[0] == LAYOUT && words[CRC_WORD] == crc_of(words);
}

void impid_settings_init(impid_settings_t *settings, const impid_flash_t *flash) {
    settings->flash = flash;
    settings->sequence = 0u;
    settings->sector = 0u;
    for (uint32_t item = 0; item < IMPID_SETTINGS; item++) {
        settings->values[item] = ranges[item].initial;
    }
    for (uint32_t sector = 0; sector < IMPID_SETTINGS_SECTORS; sector++) {
        for (uint32_t place = 0; place < places(settings); place++) {
            uint32_t words[SNAPSHOT_WORDS];
            if (load(settings, sector, place, words) && words[1] > settings->sequence) {
                settings->sector = sector;
                settings->sequence = words[1];
                for (uint32_t item = 0; item < IMPID_SETTINGS; item++) {
                    settings->values[item] = words[2u + item];
                }
            }
        }
    }
    /* Behind the last place that was ever written to, whole or torn: a torn one is not blank. */
    settings->next = 0u;
    for (uint32_t place = 0; place < places(settings); place++) {
        if (!place_blank(settings, settings->sector, place)) {
            settings->next = place + 1u;
        }
    }
}

static bool ready(const impid_settings_t *settings, uint32_t sector) {
    return read(settings, sector, 0u) == MARK && blank(settings, sector, 1u, settings->flash->sector_words);
}

static bool make_ready(impid_settings_t *settings, uint32_t sector) {
    if (ready(settings, sector)) {
        return true;
    }
    /* The mark goes first: an erase cut short must not leave a sector that looks marked and empty. */
    return program(settings, sector, 0u, 0u) && settings->flash->erase(settings->flash->context, sector) &&
           program(settings, sector, 0u, MARK);
}

bool impid_settings_prepare(impid_settings_t *settings) {
    bool in_use = settings->sequence > 0u;
    uint32_t other = (settings->sector + 1u) % IMPID_SETTINGS_SECTORS;
    return (in_use || make_ready(settings, settings->sector)) && make_ready(settings, other);
}

bool impid_settings_get(const impid_settings_t *settings, uint32_t item, uint32_t *value) {
    if (item >= IMPID_SETTINGS) {
        return false;
    }
    *value = settings->values[item];
    return true;
}

bool impid_settings_set(impid_settings_t *settings, uint32_t item, uint32_t value) {
    if (item >= IMPID_SETTINGS || value < ranges[item].low || value > ranges[item].high) {
        return false;
    }
    if (item == IMPID_SETTING_CAN_KBPS && value != 1000u && value != 500u && value != 250u) {
        return false;
    }
    settings->values[item] = value;
    return true;
}

bool impid_settings_save(impid_settings_t *settings) {
    if (settings->next >= places(settings)) {
        uint32_t other = (settings->sector + 1u) % IMPID_SETTINGS_SECTORS;
        if (!ready(settings, other)) {
            return false;
        }
        settings->sector = other;
        settings->next = 0u;
    }
    uint32_t words[SNAPSHOT_WORDS];
    words[0] = LAYOUT;
    words[1] = settings->sequence + 1u;
    for (uint32_t item = 0; item < IMPID_SETTINGS; item++) {
        words[2u + item] = settings->values[item];
    }
    words[CRC_WORD] = crc_of(words);
    /* The place is used up even if programming fails half-way. */
    uint32_t word = first_word(settings->next);
    settings->next++;
    for (uint32_t i = 0; i < SNAPSHOT_WORDS; i++) {
        if (!program(settings, settings->sector, word + i, words[i]) ||
            read(settings, settings->sector, word + i) != words[i]) {
            return false;
        }
    }
    settings->sequence++;
    return true;
}

uint32_t impid_settings_count_boot(impid_settings_t *settings) {
    settings->values[IMPID_SETTING_BOOT_COUNT]++;
    (void)impid_settings_save(settings);
    return settings->values[IMPID_SETTING_BOOT_COUNT];
}
