/* One pin, named once in board.h and set up once at start. */
#ifndef PIN_H
#define PIN_H

#include <registers.h> /* of the chip that is built for */

#include <stdbool.h>

typedef struct {
    gpio_regs_t *port;
    uint8_t number;
} pin_t;

#define PIN(PORT, NUMBER) ((pin_t){(PORT), (NUMBER)})

typedef enum { PIN_PULL_NONE = 0, PIN_PULL_UP = 1, PIN_PULL_DOWN = 2 } pin_pull_t;

void pin_analogue(pin_t pin);
void pin_input(pin_t pin, pin_pull_t pull);
void pin_output(pin_t pin);
void pin_alternate(pin_t pin, uint32_t function, pin_pull_t pull);
void pin_write(pin_t pin, bool high);
bool pin_read(pin_t pin);

#endif
