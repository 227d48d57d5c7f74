/* The two places in flash from which the firmware runs, and which of them a boot takes.
 *
 *   slot:   header | image
 *   header: the words below, 512 bytes reserved, which is the alignment that the vector table behind it needs
 *   image:  vector table, code, constants; linked for the slot it lies in
 *
 * A slot is whole if its mark, its length and the checksum of its image hold. The newest whole one is taken,
 * but one that was tried before and has not been confirmed since only if there is no other: an image that
 * does not come up, or that nobody can talk to, is gone at the next boot, and the one before it runs again.
 *
 * Data flow: the resident loader asks impid_slots_choose(), the running firmware writes the other slot
 * (impid_update). All in a header, because loader and firmware must share no code: the one outlives the
 * other. Ownership: none. Timing: one pass over the chosen image. Can fail: no slot is whole.
 */
#ifndef IMPID_SLOTS_H
#define IMPID_SLOTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IMPID_SLOTS          2u
#define IMPID_SLOT_NONE      2u
#define IMPID_SLOT_WORDS     16384u /* of header and image: the smaller of the two sectors, 64 KiB */
#define IMPID_SLOT_IMAGE     128u   /* word at which the image begins */
#define IMPID_SLOT_MARK      0x31544C53u
#define IMPID_SLOT_UNWRITTEN 0xFFFFFFFFu

/* Words of the header. The mark is written last of the first four; the last two are written once, to 0. */
enum {
    IMPID_SLOT_AT_MARK = 0,
    IMPID_SLOT_AT_BYTES = 1, /* of the image, a multiple of 4 */
    IMPID_SLOT_AT_CRC = 2,   /* CRC-32 of the image */
    IMPID_SLOT_AT_SEQUENCE = 3,
    IMPID_SLOT_AT_TRIED = 4,
    IMPID_SLOT_AT_CONFIRMED = 5
};

typedef uint32_t (*impid_slots_read_t)(void *context, uint32_t slot, uint32_t word);

/* As zlib's, four bits a step: a table of 16 words. */
static inline uint32_t impid_slots_crc_word(uint32_t crc, uint32_t word) {
    static const uint32_t steps[16] = {
        0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
        0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
        0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
    };
    uint32_t rest = crc ^ word; /* little-endian: the first byte is the lowest */
    for (uint32_t i = 0; i < 8u; i++) {
        rest = (rest >> 4) ^ steps[rest & 15u];
    }
    return rest;
}

/* CRC-32 of the first words of a slot's image. */
static inline uint32_t impid_slots_crc(impid_slots_read_t read, void *context, uint32_t slot,
                                       uint32_t words) {
    uint32_t crc = UINT32_MAX;
    for (uint32_t i = 0; i < words; i++) {
        crc = impid_slots_crc_word(crc, read(context, slot, IMPID_SLOT_IMAGE + i));
    }
    return ~crc;
}

static inline bool impid_slots_length_fits(uint32_t bytes) {
    return bytes > 0u && bytes % 4u == 0u && bytes <= 4u * (IMPID_SLOT_WORDS - IMPID_SLOT_IMAGE);
}

static inline bool impid_slots_whole(impid_slots_read_t read, void *context, uint32_t slot) {
    uint32_t bytes = read(context, slot, IMPID_SLOT_AT_BYTES);
    return read(context, slot, IMPID_SLOT_AT_MARK) == IMPID_SLOT_MARK && impid_slots_length_fits(bytes) &&
           read(context, slot, IMPID_SLOT_AT_CRC) == impid_slots_crc(read, context, slot, bytes / 4u);
}

/* Its one trial is over, and nobody has confirmed it. */
static inline bool impid_slots_failed(impid_slots_read_t read, void *context, uint32_t slot) {
    return read(context, slot, IMPID_SLOT_AT_TRIED) != IMPID_SLOT_UNWRITTEN &&
           read(context, slot, IMPID_SLOT_AT_CONFIRMED) == IMPID_SLOT_UNWRITTEN;
}

/* The slot to start, or IMPID_SLOT_NONE. */
static inline uint32_t impid_slots_choose(impid_slots_read_t read, void *context) {
    uint32_t first =
        read(context, 1u, IMPID_SLOT_AT_SEQUENCE) > read(context, 0u, IMPID_SLOT_AT_SEQUENCE) ? 1u : 0u;
    uint32_t spare = IMPID_SLOT_NONE;
    for (uint32_t i = 0; i < IMPID_SLOTS; i++) {
        uint32_t slot = (first + i) % IMPID_SLOTS;
        if (!impid_slots_whole(read, context, slot)) {
            continue;
        }
        if (!impid_slots_failed(read, context, slot)) {
            return slot;
        }
        spare = spare == IMPID_SLOT_NONE ? slot : spare;
    }
    return spare;
}

#endif
