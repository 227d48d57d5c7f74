/* The clock tree: 90 MHz from the external clock, or from the internal one if that does not come.
 *
 * 90 MHz rather than the chip's 180: it is twice what the load needs, takes no over-drive, makes every
 * divider exact (1 MHz time, 8 kHz sampling, CAN bit rates), and 45 MHz / 49 is 918367 baud, 0.35 % from
 * 921600.
 */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_TIMER_HZ 90000000u /* processor, timers on both buses */
#define CLOCK_APB1_HZ  45000000u /* USART2, CAN1 */

/* true: runs on the external clock (25 to 50 ppm); false: on the internal one (1 %). */
bool clock_start(void);

#endif
