/* The independent watchdog's refresh and its bite (chapter 20); its registers are iwdg.py's. */
#include "chip.h"

enum { KR = 0, REFRESH = 0xAAAA };

static void bite(chip *c, void *owner, uint64_t detail) {
    (void)detail;
    ((iwdg *)owner)->bite = NULL;
    chip_bite(c);
}

void iwdg_reload(iwdg *w) {
    if (w->bite != NULL) {
        schedule_cancel(w->bite);
        w->bite = NULL;
    }
    if (w->running) {
        w->bite = schedule_after_seconds(w->bank.chip, w->timeout_s, bite, w, 0);
    }
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    (void)b;
    (void)offset;
    (void)size;
    (void)value;
    return 0;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    iwdg *w = (iwdg *)b;
    if (offset != KR || size != 4 || value != REFRESH || !w->running) {
        return 0;
    }
    w->unlocked = 0;
    iwdg_reload(w);
    return 1;
}

void iwdg_bind(iwdg *w) {
    w->bank.read = read;
    w->bank.write = write;
}
