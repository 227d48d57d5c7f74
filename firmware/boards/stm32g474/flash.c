#include "flash.h"

#include "interrupts.h"
#include "registers.h"
#include "slots.h"
#include "watchdog.h"

/* Two sectors of settings, four pages of 2 KiB each, between the loader and the first slot. A word of the log
 * has 64 bits for itself, because those are written once; all zero alone may be written over something. */
#define PAGE_BYTES    2048u
#define SECTOR_PAGES  4u
#define SECTOR_WORDS  (SECTOR_PAGES * PAGE_BYTES / 8u)
#define FIRST_PAGE    16u
#define FIRST_ADDRESS 0x08008000u
#define BANK_PAGES    128u

static volatile uint32_t *settings_word(uint32_t sector, uint32_t word) {
    return (volatile uint32_t *)(uintptr_t)(FIRST_ADDRESS + 8u * (sector * SECTOR_WORDS + word));
}

/* Unbounded on purpose: the controller ends every operation, and the watchdog bites if it does not. */
static bool finish(void) {
    while ((FLASH->SR & FLASH_SR_BSY) != 0u) {
    }
    FLASH->CR = FLASH_CR_LOCK;
    return (FLASH->SR & FLASH_SR_ERRORS) == 0u;
}

static void unlock(void) {
    if ((FLASH->CR & FLASH_CR_LOCK) != 0u) {
        FLASH->KEYR = FLASH_KEY1;
        FLASH->KEYR = FLASH_KEY2;
    }
    FLASH->SR = FLASH_SR_ERRORS; /* cleared by writing 1 */
}

/* Both halves in a row: a read of the flash between them would be in the way. */
static bool program(volatile uint32_t *place, uint32_t low, uint32_t high) {
    unlock();
    uint32_t before = interrupts_mask();
    FLASH->CR = FLASH_CR_PG;
    place[0] = low;
    __asm volatile("isb" ::: "memory");
    place[1] = high;
    __asm volatile("dsb" ::: "memory");
    interrupts_restore(before);
    return finish();
}

static bool program_alone(volatile uint32_t *place, uint32_t value) {
    return program(place, value, value == 0u ? 0u : UINT32_MAX);
}

static void flush_data_cache(void) {
    FLASH->ACR &= ~FLASH_ACR_DCEN;
    FLASH->ACR |= FLASH_ACR_DCRST;
    FLASH->ACR &= ~FLASH_ACR_DCRST;
    FLASH->ACR |= FLASH_ACR_DCEN;
}

/* Pages of both banks are counted through. */
static bool erase(uint32_t first, uint32_t pages) {
    bool erased = true;
    for (uint32_t page = first; page < first + pages; page++) {
        watchdog_refresh();
        unlock();
        uint32_t command = FLASH_CR_PER | ((page % BANK_PAGES) << FLASH_CR_PNB_Pos) |
                           (page >= BANK_PAGES ? FLASH_CR_BKER : 0u);
        FLASH->CR = command;
        FLASH->CR = command | FLASH_CR_STRT;
        erased = finish() && erased;
    }
    flush_data_cache();
    watchdog_refresh();
    return erased;
}

static uint32_t read_setting(void *context, uint32_t sector, uint32_t word) {
    (void)context;
    return *settings_word(sector, word);
}

static bool program_setting(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    (void)context;
    return program_alone(settings_word(sector, word), value);
}

static bool erase_settings(void *context, uint32_t sector) {
    (void)context;
    return erase(FIRST_PAGE + sector * SECTOR_PAGES, SECTOR_PAGES);
}

const impid_flash_t flash_settings = {.context = NULL,
                                      .sector_words = SECTOR_WORDS,
                                      .read = read_setting,
                                      .program = program_setting,
                                      .erase = erase_settings};

/* The even word of a pair of the image waits for the odd one. */
static struct {
    bool there;
    uint32_t slot, word, value;
} waiting;

/* The last word of an image that has an odd number of them. */
static bool put_waiting(void) {
    bool there = waiting.there;
    waiting.there = false;
    return !there || program(slot_word(waiting.slot, waiting.word), waiting.value, UINT32_MAX);
}

static uint32_t read_slot(void *context, uint32_t slot, uint32_t word) {
    (void)context;
    if (waiting.there && waiting.slot == slot && waiting.word == word) {
        return waiting.value;
    }
    return *slot_word(slot, word);
}

static bool program_slot(void *context, uint32_t slot, uint32_t word, uint32_t value) {
    (void)context;
    if (word < IMPID_SLOT_IMAGE) {
        return put_waiting() && program_alone(slot_word(slot, word), value);
    }
    if (word % 2u == 0u) {
        waiting.there = true;
        waiting.slot = slot;
        waiting.word = word;
        waiting.value = value;
        return true;
    }
    bool paired = waiting.there && waiting.slot == slot && waiting.word + 1u == word;
    waiting.there = false;
    return paired && program(slot_word(slot, word - 1u), waiting.value, value);
}

static bool erase_slot(void *context, uint32_t slot) {
    (void)context;
    waiting.there = false;
    return erase(SLOT_PAGE(slot), SLOT_PAGES);
}

const impid_flash_t flash_slots = {.context = NULL,
                                   .sector_words = IMPID_SLOT_WORDS,
                                   .read = read_slot,
                                   .program = program_slot,
                                   .erase = erase_slot};
