#include "impid_settings.h"

#include "impid_assert.h"
#include "impid_crc32.h"

#define ERASED_WORD    0xFFFFFFFFu
#define MARK           0x494D5031u /* "1PMI" in memory */
#define LAYOUT         3u
#define COUNT_SHIFT    16u /* in the first word, above the layout: values that the snapshot holds */
#define SNAPSHOT_WORDS ((uint32_t)IMPID_SETTINGS_CAPACITY + 3u)

/* How the snapshots of a sector lie. Earlier layouts hold as many values as they have room for, and their
 * number alone in the first word. */
typedef struct {
    uint32_t layout;
    uint32_t capacity;
} format_t;

static const format_t present = {LAYOUT, IMPID_SETTINGS_CAPACITY};
static const format_t earlier[] = {{1u, 8u}, {2u, 16u}};

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
    /* Encoders are driven, some of them by 5 V; faults and sync are often left open. */
    [IMPID_SETTING_ENCODER_1_PULL] = {0u, 0u, 1u},
    [IMPID_SETTING_ENCODER_2_PULL] = {0u, 0u, 1u},
    [IMPID_SETTING_FAULT_1_PULL] = {1u, 0u, 1u},
    [IMPID_SETTING_FAULT_2_PULL] = {1u, 0u, 1u},
    [IMPID_SETTING_SYNC_PULL] = {1u, 0u, 1u},
};

static uint32_t initial_of(uint32_t item) {
    return item < IMPID_SETTINGS ? ranges[item].initial : ERASED_WORD;
}

static uint32_t read(const impid_settings_t *settings, uint32_t sector, uint32_t word) {
    return settings->flash->read(settings->flash->context, sector, word);
}

static bool program(const impid_settings_t *settings, uint32_t sector, uint32_t word, uint32_t value) {
    return settings->flash->program(settings->flash->context, sector, word, value);
}

static uint32_t words_of(const format_t *format) {
    return format->capacity + 3u;
}

/* Snapshots that a sector has room for behind its mark. */
static uint32_t places(const impid_settings_t *settings, const format_t *format) {
    return (settings->flash->sector_words - 1u) / words_of(format);
}

static uint32_t first_word(const format_t *format, uint32_t place) {
    return 1u + place * words_of(format);
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
    return blank(settings, sector, first_word(&present, place), first_word(&present, place + 1u));
}

/* Of the words before the last, which holds it. */
static uint32_t crc_of(const uint32_t words[SNAPSHOT_WORDS], const format_t *format) {
    uint8_t bytes[4u * (SNAPSHOT_WORDS - 1u)];
    uint32_t count = 4u * (words_of(format) - 1u);
    for (uint32_t i = 0; i < count; i++) {
        bytes[i] = (uint8_t)(words[i / 4u] >> (8u * (i % 4u)));
    }
    return impid_crc32(bytes, count);
}

/* The values that a snapshot's first word promises; none if it is not of this format. */
static uint32_t values_in(uint32_t first, const format_t *format) {
    if (format->layout != LAYOUT) {
        return first == format->layout ? format->capacity : 0u;
    }
    uint32_t count = first >> COUNT_SHIFT;
    return (first & UINT16_MAX) == LAYOUT && count <= format->capacity ? count : 0u;
}

static bool load(const impid_settings_t *settings, const format_t *format, uint32_t sector, uint32_t place,
                 uint32_t words[SNAPSHOT_WORDS]) {
    uint32_t first = first_word(format, place);
    words[0] = read(settings, sector, first);
    if (values_in(words[0], format) == 0u) {
        return false;
    }
    for (uint32_t i = 1; i < words_of(format); i++) {
        words[i] = read(settings, sector, first + i);
    }
    return words[words_of(format) - 1u] == crc_of(words, format);
}

static void take_newest(impid_settings_t *settings, const format_t *format) {
    for (uint32_t sector = 0; sector < IMPID_SETTINGS_SECTORS; sector++) {
        for (uint32_t place = 0; place < places(settings, format); place++) {
            uint32_t words[SNAPSHOT_WORDS] = {0};
            if (!load(settings, format, sector, place, words) || words[1] <= settings->sequence) {
                continue;
            }
            settings->sector = sector;
            settings->sequence = words[1];
            settings->earlier_layout = format->layout != LAYOUT;
            uint32_t count = values_in(words[0], format);
            for (uint32_t item = 0; item < IMPID_SETTINGS_CAPACITY; item++) {
                settings->values[item] = item < count ? words[2u + item] : initial_of(item);
            }
            settings->count = count > IMPID_SETTINGS ? count : (uint32_t)IMPID_SETTINGS;
        }
    }
}

void impid_settings_init(impid_settings_t *settings, const impid_flash_t *flash) {
    settings->flash = flash;
    settings->sequence = 0u;
    settings->sector = 0u;
    settings->count = IMPID_SETTINGS;
    settings->earlier_layout = false;
    for (uint32_t item = 0; item < IMPID_SETTINGS_CAPACITY; item++) {
        settings->values[item] = initial_of(item);
    }
    for (uint32_t i = 0; i < sizeof earlier / sizeof earlier[0]; i++) {
        take_newest(settings, &earlier[i]);
    }
    take_newest(settings, &present);
    /* Behind the last place that was ever written to, whole or torn: a torn one is not blank. A sector keeps
     * the layout that it began with, so the first save of this one goes to the other. */
    settings->next = settings->earlier_layout ? places(settings, &present) : 0u;
    for (uint32_t place = settings->next; place < places(settings, &present); place++) {
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
    if (settings->next >= places(settings, &present)) {
        uint32_t other = (settings->sector + 1u) % IMPID_SETTINGS_SECTORS;
        if (!ready(settings, other)) {
            return false;
        }
        settings->sector = other;
        settings->next = 0u;
    }
    IMPID_ASSERT(settings->sector < IMPID_SETTINGS_SECTORS && settings->next < places(settings, &present));
    IMPID_ASSERT(settings->count > 0u && settings->count <= IMPID_SETTINGS_CAPACITY);
    uint32_t words[SNAPSHOT_WORDS];
    words[0] = LAYOUT | (settings->count << COUNT_SHIFT);
    words[1] = settings->sequence + 1u;
    for (uint32_t item = 0; item < IMPID_SETTINGS_CAPACITY; item++) {
        words[2u + item] = item < settings->count ? settings->values[item] : ERASED_WORD;
    }
    words[SNAPSHOT_WORDS - 1u] = crc_of(words, &present);
    /* The place is used up even if programming fails half-way. */
    uint32_t word = first_word(&present, settings->next);
    settings->next++;
    settings->earlier_layout = false;
    for (uint32_t i = 0; i < SNAPSHOT_WORDS; i++) {
        if ((words[i] != ERASED_WORD && !program(settings, settings->sector, word + i, words[i])) ||
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
