/* From the sampling timer to the core's tick, with every instant set by hardware: as on the other board
 * (boards/stm32f446/sampling.h), but each reading is the sum of 16 conversions.
 *
 * TIM3 overflows every 125 us. Its trigger output starts ADC1 and ADC2 together, each of which converts its
 * channel 16 times in a row and adds the results up, and makes TIM2 and TIM5 copy their encoder counts.
 *
 * Skew between the encoder latch and the reading, from the same edge (timers 144 MHz, ADC clock 36 MHz, 27.8
 * ns): encoder: as there, at 144 MHz                                      the counts are those of -0.06 ..
 * -0.02 us ADC:     25 clocks a conversion, of which 12.5 are sampling, at whose end the voltage is held: the
 * n-th at (25 n + 12.5) / 36 us, their mean at 5.56 us; the trigger takes 2 to 3 clocks, 0.06 .. 0.08 us So
 * the voltage is that of 5.64 us after the counts, constant to 0.06 us. The sensor's descriptor takes it off
 * the group delay (impid_adxl203_oversampled): of 2006 us 2000 remain.
 *
 * 12.5 clocks of sampling are 347 ns: behind the 10 nF filter capacitor the sampling capacitor (5 pF) settles
 * within them through the converter's own resistance many times over, and 16 conversions take 0.8 % of the
 * difference between two readings of the same axis from the filter capacitor, as the sum of what each takes.
 *
 * The supply is measured meanwhile: eight times a second, just behind a tick, ADC1 converts the internal
 * reference once as an injected conversion, 7 us, which is not oversampled.
 */
#ifndef SAMPLING_H
#define SAMPLING_H

#include "impid_core.h"

/* VDDA, which supplies the accelerometer, from the reference voltage: once before sampling_start(), which
 * goes on measuring it. */
void sampling_measure_supply(void);
/* Starts the time and the samples; from here on the tick interrupt calls the core. */
void sampling_start(impid_core_t *core);
/* Ticks served since start. */
uint32_t sampling_ticks(void);
/* Adds the tick's part to the account. */
void sampling_health(impid_port_health_t *health);

#endif
