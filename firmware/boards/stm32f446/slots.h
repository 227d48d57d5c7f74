/* Where the two slots lie: sector 4 (64 KiB), and as much of sector 5 (128 KiB). */
#ifndef SLOTS_H
#define SLOTS_H

#include "impid_slots.h"
#include "registers.h"

#define SLOT_0_BASE       0x08010000u
#define SLOT_1_BASE       0x08020000u
#define SLOT_SECTOR(slot) (4u + (slot))
#define SLOT_BASE(slot)   ((slot) == 0u ? SLOT_0_BASE : SLOT_1_BASE)

static inline volatile uint32_t *slot_word(uint32_t slot, uint32_t word) {
    return (volatile uint32_t *)(uintptr_t)(SLOT_BASE(slot) + 4u * word);
}

/* The loader's: begins to write zeros over a word of a header, of an unlocked flash. */
static inline void slot_clear_word(volatile uint32_t *place) {
    FLASH->CR = FLASH_CR_PSIZE_X32 | FLASH_CR_PG;
    *place = 0u;
}

#endif
