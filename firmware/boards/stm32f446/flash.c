#include "flash.h"

#include "fault.h"
#include "registers.h"
#include "slots.h"
#include "watchdog.h"

#define SECTOR_WORDS  (16384u / 4u)
#define FIRST_SECTOR  2u /* sectors 2 and 3, 0x08008000 and 0x0800C000: between the loader and the slots */
#define FIRST_ADDRESS 0x08008000u

static volatile uint32_t *settings_word(uint32_t sector, uint32_t word) {
    return (volatile uint32_t *)(uintptr_t)(FIRST_ADDRESS + 4u * (sector * SECTOR_WORDS + word));
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

static bool cut_ahead;
static uint32_t words_to_cut;

void flash_cut_after(uint32_t words) {
    words_to_cut = words;
    cut_ahead = true;
}

static bool program(volatile uint32_t *place, uint32_t value) {
    if (cut_ahead && words_to_cut == 0u) {
        fault_reset();
    }
    words_to_cut -= cut_ahead ? 1u : 0u;
    unlock();
    FLASH->CR = FLASH_CR_PSIZE_X32 | FLASH_CR_PG;
    *place = value;
    __asm volatile("dsb" ::: "memory");
    return finish();
}

static bool erase(uint32_t sector) {
    watchdog_refresh();
    unlock();
    uint32_t command = FLASH_CR_PSIZE_X32 | FLASH_CR_SER | (sector << FLASH_CR_SNB_Pos);
    FLASH->CR = command;
    FLASH->CR = command | FLASH_CR_STRT;
    bool erased = finish();
    /* The data cache may still hold what was erased (RM0390 3.5.3); it is flushed while off. */
    FLASH->ACR &= ~FLASH_ACR_DCEN;
    FLASH->ACR |= FLASH_ACR_DCRST;
    FLASH->ACR &= ~FLASH_ACR_DCRST;
    FLASH->ACR |= FLASH_ACR_DCEN;
    watchdog_refresh();
    return erased;
}

static uint32_t read_setting(void *context, uint32_t sector, uint32_t word) {
    (void)context;
    return *settings_word(sector, word);
}

static bool program_setting(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    (void)context;
    return program(settings_word(sector, word), value);
}

static bool erase_settings(void *context, uint32_t sector) {
    (void)context;
    return erase(FIRST_SECTOR + sector);
}

const impid_flash_t flash_settings = {.context = NULL,
                                      .sector_words = SECTOR_WORDS,
                                      .read = read_setting,
                                      .program = program_setting,
                                      .erase = erase_settings};

static uint32_t read_slot(void *context, uint32_t slot, uint32_t word) {
    (void)context;
    return *slot_word(slot, word);
}

static bool program_slot(void *context, uint32_t slot, uint32_t word, uint32_t value) {
    (void)context;
    return program(slot_word(slot, word), value);
}

static bool erase_slot(void *context, uint32_t slot) {
    (void)context;
    return erase(SLOT_SECTOR(slot));
}

const impid_flash_t flash_slots = {.context = NULL,
                                   .sector_words = IMPID_SLOT_WORDS,
                                   .read = read_slot,
                                   .program = program_slot,
                                   .erase = erase_slot};
