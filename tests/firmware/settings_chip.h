/* Settings on a flash that obeys the rules of the real one (erase sets all bits of a sector, programming only
 * clears bits) and whose power can be cut after any byte written or at any point of an erase. */
#ifndef SETTINGS_CHIP_H
#define SETTINGS_CHIP_H

#include "impid_settings.h"

#include <setjmp.h>

#define SECTOR_WORDS 150u /* room for three snapshots: the sectors change often */
#define SECTOR_BYTES (4u * SECTOR_WORDS)
#define NEVER        0xFFFFFFFFu

typedef struct {
    uint8_t bytes[2][SECTOR_BYTES];
    uint32_t steps_left; /* bytes programmed or erased until the power goes */
    jmp_buf power_cut;
    uint32_t operations_left; /* programs and erases until flash refuses */
    uint32_t erases;
} fake_flash_t;

extern fake_flash_t chip;
extern impid_settings_t settings;

/* The flash's own functions, for a flash of one's own as well. */
uint32_t chip_read(void *context, uint32_t sector, uint32_t word);
bool chip_program(void *context, uint32_t sector, uint32_t word, uint32_t value);
bool chip_erase(void *context, uint32_t sector);

/* A new flash, and a first boot on it that has written nothing. */
void chip_new(void);
/* The settings as the next boot finds them. */
void boot(void);
uint32_t value_of(uint32_t item);
void count_one_boot(void);
/* True if `run` ended before so many bytes were written or erased; then power comes back, and a boot. */
bool with_power_for(uint32_t steps, void (*run)(void));

#endif
