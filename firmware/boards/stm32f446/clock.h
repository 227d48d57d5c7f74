/* The clock tree: 90 MHz from the external clock, or from the internal one if that does not come.
 *
 * 90 MHz rather than the chip's 180: it is twice what the load needs, takes no over-drive, makes every
 * divider exact (1 MHz time, 8 kHz sampling, CAN bit rates), and 45 MHz / 49 is 918367 baud, 0.35 % from
 * 921600.
 */
#ifndef CLOCK_H
#define CLOCK_H

#include "registers.h"

#include <stdbool.h>

#define CLOCK_TIMER_HZ 90000000u /* processor, timers on both buses */
#define CLOCK_APB1_HZ  45000000u /* USART2, CAN1 */

/* true: runs on the external clock (25 to 50 ppm); false: on the internal one (1 %). */
bool clock_start(void);
/* Clocks the ports that carry pins. */
void clock_start_ports(void);

/* The external clock as the internal oscillator (1 %) counted it at boot; 0: there was none, or it was not
 * counted. */
uint32_t clock_external_hz(void);

/* Clocks a peripheral. The read makes the first access wait until the clock is there (errata sheet ES0298,
 * delay after an RCC peripheral clock enabling). */
static inline void clock_enable(reg_t *enable, uint32_t bits) {
    *enable |= bits;
    (void)*enable;
}

#endif
