/* Levels of a port (7.4): the two registers that a running program uses; the others are gpio.py's. */
#include "chip.h"

enum { MODER = 0x00, PUPDR = 0x0C, IDR = 0x10, ODR = 0x14, BSRR = 0x18 };

/* An output's own level, what drives the pin, or its pull resistor; analogue pins read 0. */
uint32_t gpio_inputs(const gpio *g) {
    uint32_t levels = 0;
    for (uint32_t pin = 0; pin < 16; ++pin) {
        const uint32_t mode = g->reg[MODER / 4] >> 2 * pin & 3u;
        uint32_t level = 0;
        if (mode == 1) {
            level = g->reg[ODR / 4] >> pin & 1u;
        } else if (mode != 3) {
            level = (g->driven >> pin & 1u) != 0 ? g->levels >> pin & 1u
                                                 : (uint32_t)((g->reg[PUPDR / 4] >> 2 * pin & 3u) == 1);
        }
        levels |= level << pin;
    }
    return levels;
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    if (offset != IDR || size != 4) {
        return 0;
    }
    *value = gpio_inputs((gpio *)b);
    return 1;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    gpio *g = (gpio *)b;
    if (offset != BSRR || size != 4) {
        return 0;
    }
    g->reg[ODR / 4] = ((g->reg[ODR / 4] & ~(value >> 16)) | value) & 0xFFFFu; /* setting wins */
    return 1;
}

void gpio_bind(gpio *g) {
    g->bank.read = read;
    g->bank.write = write;
}
