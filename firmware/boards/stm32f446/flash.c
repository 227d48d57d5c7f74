#include "flash.h"

#include "registers.h"

#define SECTOR_WORDS  (16384u / 4u)
#define FIRST_SECTOR  2u /* sectors 2 and 3, 0x08008000 and 0x0800C000: behind the program's 32 KiB */
#define FIRST_ADDRESS 0x08008000u

static volatile uint32_t *word_at(uint32_t sector, uint32_t word) {
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

static uint32_t read_word(void *context, uint32_t sector, uint32_t word) {
    (void)context;
    return *word_at(sector, word);
}

static bool program_word(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    (void)context;
    unlock();
    FLASH->CR = FLASH_CR_PSIZE_X32 | FLASH_CR_PG;
    *word_at(sector, word) = value;
    __asm volatile("dsb" ::: "memory");
    return finish();
}

static bool erase_sector(void *context, uint32_t sector) {
    (void)context;
    unlock();
    uint32_t command = FLASH_CR_PSIZE_X32 | FLASH_CR_SER | ((FIRST_SECTOR + sector) << FLASH_CR_SNB_Pos);
    FLASH->CR = command;
    FLASH->CR = command | FLASH_CR_STRT;
    bool erased = finish();
    /* The data cache may still hold what was erased (RM0390 3.5.3); it is flushed while off. */
    FLASH->ACR &= ~FLASH_ACR_DCEN;
    FLASH->ACR |= FLASH_ACR_DCRST;
    FLASH->ACR &= ~FLASH_ACR_DCRST;
    FLASH->ACR |= FLASH_ACR_DCEN;
    return erased;
}

const impid_flash_t flash_port = {.context = NULL,
                                  .sector_words = SECTOR_WORDS,
                                  .read = read_word,
                                  .program = program_word,
                                  .erase = erase_sector};
