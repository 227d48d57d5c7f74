/* The two flash sectors of the settings, as the core's settings reach them.
 *
 * The processor runs from the same flash and stands still while a word is programmed (16 us typically) or a
 * sector erased (0.25 s typically, 0.5 s at most): sampling goes on by itself meanwhile, a programmed word
 * costs a tick nothing, an erase would cost it conversions. Hence erasing happens before sampling starts.
 */
#ifndef FLASH_H
#define FLASH_H

#include "impid_settings.h"

extern const impid_flash_t flash_port;

#endif
