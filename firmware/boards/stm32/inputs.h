/* The inputs from outside: encoders, fault lines, sync, each with the chip's own resistor as the settings
 * say. */
#ifndef INPUTS_H
#define INPUTS_H

#include "impid_settings.h"

/* Above VDD + 0.3 V a pin stands only without its pull (STM32F446xC/xE data sheet, I/O static
 * characteristics), so the inputs to which 5 V may come are as the settings say, and without any until those
 * are read. */
void inputs_start(const impid_settings_t *settings);
/* For the bench test, with nothing wired to them: the resistors alone hold the encoder inputs, bits 0 to 3 of
 * `levels` being lines A and B of encoder 1, then of encoder 2; 1 is high. */
void inputs_hold(uint32_t levels);

#endif
