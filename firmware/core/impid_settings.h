/* What the board remembers without power: settings and calibration, in two sectors of flash.
 *
 * How it survives a power cut: values are never overwritten. Each save appends one snapshot of all of them
 * with a sequence number and a checksum to the sector in use; the newest snapshot whose checksum holds is the
 * truth. A snapshot torn by a power cut is skipped, its place is not used again, and the one before it still
 * counts. When a sector is full the next snapshot goes to the other one, which was erased beforehand; the
 * full sector keeps the old truth until the new one stands.
 *
 *   sector:   mark | snapshot | snapshot | ... | erased
 *   mark:     one word, written after an erase has ended, cleared before the next one begins: a sector whose
 *             erase was cut short is erased again, even if it happens to read as empty
 *   snapshot: layout and number of values, sequence, values, room for more, CRC-32 of these
 *
 * How it survives another firmware: the layout keeps its size, new values take of the room behind the others.
 * A firmware gives values that a snapshot does not hold their defaults, and keeps those that it does not
 * know, so that going back to an older firmware and forth again loses nothing. Layouts 1 and 2, of the time
 * before, had 8 and 16 values and no room: they are read where they lie, and the next save goes to the other
 * sector.
 *
 * Data flow: init() finds the newest snapshot; set() changes values in RAM, save() appends them.
 * Ownership: the caller's; flash is reached through three functions of the port.
 * Timing: main loop. init(): a few passes over both sectors. save(): one word programmed per value and three
 * more, no erase. Erasing takes up to half a second and stalls the processor, so it is in prepare() alone,
 * which the port calls before it samples. Can fail: set() on an unknown item, a read-only one or a value out
 * of range; save() if flash refuses or both sectors have been filled since prepare().
 */
#ifndef IMPID_SETTINGS_H
#define IMPID_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IMPID_SETTINGS_SECTORS  2u
#define IMPID_SETTINGS_CAPACITY 45u /* values, for ever: part of the layout */

typedef struct {
    void *context;
    uint32_t sector_words;
    /* Words as they stand; `word` below sector_words. */
    uint32_t (*read)(void *context, uint32_t sector, uint32_t word);
    /* Clears bits of an erased word. false: flash refused. */
    bool (*program)(void *context, uint32_t sector, uint32_t word, uint32_t value);
    /* All bits of the sector to 1. false: flash refused. */
    bool (*erase)(void *context, uint32_t sector);
} impid_flash_t;

/* In this order in the snapshot; new ones go to the end, and none ever goes away. */
typedef enum {
    IMPID_SETTING_BOOT_COUNT = 0,    /* boots ever; its low half is the boot id. Read-only */
    IMPID_SETTING_CAN_KBPS = 1,      /* 1000, 500 or 250; from the next boot on */
    IMPID_SETTING_ACCEL_X_ZERO = 2,  /* 16-bit code at 0 g */
    IMPID_SETTING_ACCEL_Y_ZERO = 3,  /* 16-bit code at 0 g */
    IMPID_SETTING_ACCEL_X_PER_G = 4, /* 16-bit codes per g */
    IMPID_SETTING_ACCEL_Y_PER_G = 5, /* 16-bit codes per g */
    IMPID_SETTING_ENCODER_1_CPR = 6, /* counts per turn, 0: not known */
    IMPID_SETTING_ENCODER_2_CPR = 7, /* counts per turn, 0: not known */
    /* How far the axes are turned against the board's, signed microradians, and how sure all six numbers are:
     * half the 95 % interval in thousandths of a code (per g), in microradians; 0: never calibrated. */
    IMPID_SETTING_ACCEL_X_ANGLE = 8,
    IMPID_SETTING_ACCEL_Y_ANGLE = 9,
    IMPID_SETTING_ACCEL_X_ZERO_INTERVAL = 10,
    IMPID_SETTING_ACCEL_Y_ZERO_INTERVAL = 11,
    IMPID_SETTING_ACCEL_X_PER_G_INTERVAL = 12,
    IMPID_SETTING_ACCEL_Y_PER_G_INTERVAL = 13,
    IMPID_SETTING_ACCEL_X_ANGLE_INTERVAL = 14,
    IMPID_SETTING_ACCEL_Y_ANGLE_INTERVAL = 15,
    /* 1: the chip's own resistor (40 kOhm) holds the input while nothing drives it: encoders and faults high,
     * sync low. 0: nothing does, which an input needs that may see more than 3.6 V. From the next boot on. */
    IMPID_SETTING_ENCODER_1_PULL = 16,
    IMPID_SETTING_ENCODER_2_PULL = 17,
    IMPID_SETTING_FAULT_1_PULL = 18,
    IMPID_SETTING_FAULT_2_PULL = 19,
    IMPID_SETTING_SYNC_PULL = 20,
    IMPID_SETTINGS = 21
} impid_setting_t;

typedef struct {
    const impid_flash_t *flash;
    uint32_t values[IMPID_SETTINGS_CAPACITY];
    uint32_t count;      /* of these that a snapshot holds: at least ours */
    bool earlier_layout; /* that of the newest snapshot */
    uint32_t sequence;   /* of the newest snapshot */
    uint32_t sector;     /* that holds it */
    uint32_t next;       /* snapshot place in that sector, the first never written to */
} impid_settings_t;

/* Loads the newest snapshot, or the defaults where there is none. Writes nothing. */
void impid_settings_init(impid_settings_t *settings, const impid_flash_t *flash);
/* Makes room: after it a sector's worth of saves needs no erase. false: flash refused. */
bool impid_settings_prepare(impid_settings_t *settings);
/* false: no such item. */
bool impid_settings_get(const impid_settings_t *settings, uint32_t item, uint32_t *value);
/* false: no such item for setting, or a value out of its range; nothing changed then. */
bool impid_settings_set(impid_settings_t *settings, uint32_t item, uint32_t value);
/* false: not saved; the snapshot before stands. */
bool impid_settings_save(impid_settings_t *settings);
/* Counts this boot and saves; returns the count. */
uint32_t impid_settings_count_boot(impid_settings_t *settings);

#endif
