/* Where the two slots lie, one in each bank of the flash: 64 KiB from page 32 of the first on, and from page
 * 0 of the second on.
 *
 * The flash is written 64 bits at a time, and once: a word of a header, each of which is written at a moment
 * of its own, has 64 bits for itself. The image behind it is as the processor reads it. */
#ifndef SLOTS_H
#define SLOTS_H

#include "impid_slots.h"
#include "registers.h"

#define SLOT_0_BASE     0x08010000u
#define SLOT_1_BASE     0x08040000u
#define SLOT_PAGES      32u
#define SLOT_PAGE(slot) ((slot) == 0u ? 32u : 128u) /* of both banks: the second begins at 128 */
#define SLOT_BASE(slot) ((slot) == 0u ? SLOT_0_BASE : SLOT_1_BASE)

static inline volatile uint32_t *slot_word(uint32_t slot, uint32_t word) {
    uint32_t bytes = word < IMPID_SLOT_IMAGE ? 8u * word : 4u * word;
    return (volatile uint32_t *)(uintptr_t)(SLOT_BASE(slot) + bytes);
}

/* The loader's: begins to write zeros over a word of a header, of an unlocked flash. */
static inline void slot_clear_word(volatile uint32_t *place) {
    FLASH->CR = FLASH_CR_PG;
    place[0] = 0u;
    __asm volatile("isb" ::: "memory");
    place[1] = 0u; /* 64 bits at a time */
}

#endif
