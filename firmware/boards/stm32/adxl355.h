/* The ADXL355 on SPI2, in step with the ticks.
 *
 * The sensor's own clock is good to a few percent, so it is told when to sample: TIM1, started by the same
 * trigger as the sampling timer, raises SYNC 220 us before each tick, and the sensor's interpolation filter
 * gives the value of that moment (EXT_SYNC 10). Its filter is 1780 us late at 1000 Hz: together two ticks,
 * which the core takes off. What is left is the resolution of the interpolation, 1/64 of a period: 16 us.
 *
 * Data flow: adxl355_read(), in the tick, fetches the part's number, its status and the three axes in one
 * transfer, 16 bytes at 5.6 MHz: 23 us and as much as the loop takes. Readings are offset binary; all 0, the
 * lower rail, which the core flags, where the sensor does not answer as itself or has nothing new since the
 * last tick: a loose wire shows in the very sample. It is then set up anew with each tick until it answers.
 * Ownership: SPI2, TIM1 and their pins. start() before sampling_start(), self_test() in the main loop, read()
 * in the tick. Can fail: a missing sensor, as above; every wait is bounded.
 *
 * Registers and codes: ADXL354/ADXL355 data sheet.
 */
#ifndef ADXL355_H
#define ADXL355_H

#include <stdbool.h>
#include <stdint.h>

/* Between SYNC, 780 us after a tick's instant, and there the sensor holds that tick's readings; less the
 * transfer. */
#define ADXL355_READABLE_US 750u

void adxl355_start(void);
void adxl355_read(uint32_t reading[]);
void adxl355_self_test(bool on);

#endif
