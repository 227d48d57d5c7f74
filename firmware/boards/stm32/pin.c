#include "pin.h"

enum { MODE_INPUT = 0, MODE_OUTPUT = 1, MODE_ALTERNATE = 2, MODE_ANALOGUE = 3, SPEED_MEDIUM = 1 };

static void set_two_bits(reg_t *reg, uint8_t number, uint32_t value) {
    *reg = (*reg & ~(3u << (2u * number))) | (value << (2u * number));
}

void pin_analogue(pin_t pin) {
    set_two_bits(&pin.port->PUPDR, pin.number, PIN_PULL_NONE);
    set_two_bits(&pin.port->MODER, pin.number, MODE_ANALOGUE);
}

void pin_input(pin_t pin, pin_pull_t pull) {
    set_two_bits(&pin.port->PUPDR, pin.number, (uint32_t)pull);
    set_two_bits(&pin.port->MODER, pin.number, MODE_INPUT);
}

void pin_output(pin_t pin) {
    pin_write(pin, false);
    set_two_bits(&pin.port->MODER, pin.number, MODE_OUTPUT);
}

void pin_alternate(pin_t pin, uint32_t function, pin_pull_t pull) {
    reg_t *afr = &pin.port->AFR[pin.number / 8u];
    uint32_t shift = 4u * (pin.number % 8u);
    *afr = (*afr & ~(15u << shift)) | (function << shift);
    set_two_bits(&pin.port->PUPDR, pin.number, (uint32_t)pull);
    set_two_bits(&pin.port->OSPEEDR, pin.number, SPEED_MEDIUM);
    set_two_bits(&pin.port->MODER, pin.number, MODE_ALTERNATE);
}

void pin_write(pin_t pin, bool high) {
    pin.port->BSRR = high ? 1u << pin.number : 1u << (pin.number + 16u);
}

bool pin_read(pin_t pin) {
    return ((pin.port->IDR >> pin.number) & 1u) != 0u;
}
