/* The resident loader: chooses the slot to run and jumps into it. It lies in the first sector, which no
 * update touches.
 *
 * It shares no code with the firmware, which comes and goes: everything it calls is in this file or inline in
 * the headers, and a test holds its object file to that. It has no variables. It runs on the internal clock,
 * and from it on the watchdog: an image that hangs is reset, and at its second start the one before takes its
 * place.
 */
#include "impid_slots.h"
#include "interrupts.h"
#include "registers.h"
#include "slots.h"
#include "watchdog.h"

_Noreturn void loader_reset(void);

/* No image, or a fault before one runs: the debugger's business, or the ROM's (BOOT0). */
static _Noreturn void stop(void) {
    for (;;) {
    }
}

__attribute__((section(".loader_vectors"), used)) static const struct {
    uint32_t *stack_top;
    handler_t reset;
    handler_t others[14];
} loader_vectors = {
    .stack_top = linker_stack_top,
    .reset = loader_reset,
    .others = {[0 ... 13] = stop},
};

static uint32_t read_word(void *context, uint32_t slot, uint32_t word) {
    (void)context;
    return *slot_word(slot, word);
}

/* Its one trial begins. Should this fail, the image is tried again at the next boot, no worse. */
static void mark_tried(uint32_t slot) {
    FLASH->KEYR = FLASH_KEY1;
    FLASH->KEYR = FLASH_KEY2;
    FLASH->SR = FLASH_SR_ERRORS;
    slot_clear_word(slot_word(slot, IMPID_SLOT_AT_TRIED));
    __asm volatile("dsb" ::: "memory");
    while ((FLASH->SR & FLASH_SR_BSY) != 0u) {
    }
    FLASH->CR = FLASH_CR_LOCK;
}

/* As the processor itself starts from a vector table: its first word is the stack, its second the code. */
static _Noreturn void start(uint32_t vectors) {
    __asm volatile("ldr r1, [%0, #4]\n\t"
                   "ldr r0, [%0]\n\t"
                   "mov sp, r0\n\t"
                   "bx r1\n" ::"r"(vectors)
                   : "r0", "r1", "memory");
    stop();
}

void loader_reset(void) {
    watchdog_start();
    uint32_t slot = impid_slots_choose(read_word, NULL);
    if (slot == IMPID_SLOT_NONE) {
        for (;;) {
            watchdog_refresh();
        }
    }
    if (*slot_word(slot, IMPID_SLOT_AT_TRIED) == IMPID_SLOT_UNWRITTEN) {
        mark_tried(slot);
    }
    start((uint32_t)(uintptr_t)slot_word(slot, IMPID_SLOT_IMAGE));
}
