/* The flash as the core reaches it: the two sectors of the settings, and the two slots of the firmware.
 *
 * The processor runs from the same flash and stands still while a word is programmed (16 us typically) or a
 * sector erased (16 KiB: 0.25 s typically, 0.5 s at most; a slot's sector of 128 KiB: 1 s and 2 s): sampling
 * goes on by itself meanwhile, a programmed word costs a tick nothing, an erase would cost it conversions.
 * Hence the settings are erased before sampling starts, and a slot only while nothing streams. The watchdog
 * is refreshed on both sides.
 */
#ifndef FLASH_H
#define FLASH_H

#include "impid_settings.h"

extern const impid_flash_t flash_settings;
extern const impid_flash_t flash_slots;

/* For the bench test: a reset in place of the word that comes after so many more. */
void flash_cut_after(uint32_t words);

#endif
