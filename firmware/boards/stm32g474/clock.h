/* The clock tree: 144 MHz from the external crystal, or from the internal oscillator if that does not come.
 *
 * 144 of 170 MHz: range 1 without its boost mode reaches 150, and every divider is exact (1 MHz time, 8 kHz
 * sampling, CAN bit rates); 144 MHz / 156 is 923077 baud, 0.16 % from 921600.
 */
#ifndef CLOCK_H
#define CLOCK_H

#include "registers.h"

#include <stdbool.h>

#define CLOCK_TIMER_HZ 144000000u /* processor, both buses, timers, FDCAN */
#define CLOCK_APB1_HZ  144000000u

/* true: runs on the external clock (25 to 50 ppm); false: on the internal one (1 %). */
bool clock_start(void);
/* Clocks the ports that carry pins. */
void clock_start_ports(void);

/* 0: nothing counts the external clock on this chip yet. */
static inline uint32_t clock_external_hz(void) {
    return 0u;
}

/* Clocks a peripheral; the read makes the first access wait until the clock is there. */
static inline void clock_enable(reg_t *enable, uint32_t bits) {
    *enable |= bits;
    (void)*enable;
}

#endif
