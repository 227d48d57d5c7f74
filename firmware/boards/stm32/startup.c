/* From reset to main(). */
#include "vectors.h"

#include <string.h>

int main(void);

extern uint8_t linker_data_start[];
extern uint8_t linker_data_end[];
extern const uint8_t linker_data_image[];
extern uint8_t linker_bss_start[];
extern uint8_t linker_bss_end[];

/* The linker's symbols mark places in one memory, which C cannot know: hence numbers, not pointers. */
static size_t bytes_between(const uint8_t *start, const uint8_t *end) {
    return (uintptr_t)end - (uintptr_t)start;
}

void reset_handler(void) {
    SCB->VTOR = (uint32_t)(uintptr_t)&vectors;
    (void)memcpy(linker_data_start, linker_data_image, bytes_between(linker_data_start, linker_data_end));
    (void)memset(linker_bss_start, 0, bytes_between(linker_bss_start, linker_bss_end));
    (void)main();
    unexpected_handler();
}
