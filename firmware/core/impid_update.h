/* A new firmware comes in, word by word, into the slot that does not run.
 *
 * Data flow: begin() erases the other slot, write() appends words, finish() compares the checksum, looks
 * whether the image was linked for that slot, and writes the header: from the next boot on the loader tries
 * it once. confirm() makes the running image stay; without it the boot after takes the one before again. How
 * it survives a power cut: the slot that runs is never touched, and the other counts only from the last word
 * of its header on. Ownership: the caller's; flash is reached through the port's functions, in which a sector
 * is a slot. Timing: main loop. begin() stalls the processor for up to two seconds (the erase of a large
 * sector), finish() for the checksum, some 20 ms. Not while samples are taken. Can fail: the result says how.
 */
#ifndef IMPID_UPDATE_H
#define IMPID_UPDATE_H

#include "impid_settings.h"
#include "impid_slots.h"

typedef struct {
    const impid_flash_t *flash; /* sector_words: IMPID_SLOT_WORDS */
    uint32_t base[IMPID_SLOTS]; /* the address at which each slot begins */
    uint32_t running;           /* the slot of the running image */
} impid_update_port_t;

typedef struct {
    const impid_update_port_t *port;
    uint32_t bytes; /* announced; 0: no update under way */
    uint32_t next;  /* word of the image to be written next */
    uint32_t last;  /* the word written last */
} impid_update_t;

typedef enum {
    IMPID_UPDATE_OK,
    IMPID_UPDATE_BAD_VALUE,
    IMPID_UPDATE_BAD_ITEM,
    IMPID_UPDATE_FAILED
} impid_update_result_t;

void impid_update_init(impid_update_t *update, const impid_update_port_t *port);
/* The slot that an update goes to: for which its image must be linked. */
uint32_t impid_update_slot(const impid_update_t *update);
impid_update_result_t impid_update_begin(impid_update_t *update, uint32_t bytes);
/* `low`: low byte of the word's number. The word before may come again: its answer was lost. */
impid_update_result_t impid_update_write(impid_update_t *update, uint8_t low, uint32_t word);
impid_update_result_t impid_update_finish(impid_update_t *update, uint32_t crc);
impid_update_result_t impid_update_confirm(impid_update_t *update);
/* The running image has been confirmed, or never needed it. */
bool impid_update_confirmed(const impid_update_t *update);

#endif
