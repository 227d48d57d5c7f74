/* From the sampling timer to the core's tick, with every instant set by hardware.
 *
 * TIM3 overflows every 125 us. Its trigger output starts ADC1 and ADC2 together (regular simultaneous mode)
 * and, through the internal trigger inputs, makes TIM2 and TIM5 copy their encoder counts into a capture
 * register. DMA carries all three into memory, two halves of eight conversions each: when one is full, the
 * tick interrupt hands it to the core while the other fills.
 *
 * Skew between the encoder latch and the conversion, from the same edge of TIM3's trigger (f = 90 MHz, ADC
 * clock 22.5 MHz, 44.4 ns):
 *   encoder: resynchronisation of an internal trigger and capture      2 to 4 timer clocks    0.02 .. 0.05 us
 *            input filter: 8 readings, and 2 clocks of synchronisation after the edge on the pin
 *                                                                      the count is behind    0.09 .. 0.12 us
 *   ADC:     trigger to start of sampling                              2 to 3 ADC clocks      0.09 .. 0.14 us
 *            sampling, at whose end the voltage is held                15 ADC clocks                  0.67 us
 *   The counts captured are those of -0.10 .. -0.04 us, the voltage is that of +0.76 .. +0.81 us.
 *
 * So the skew is 0.80 .. 0.91 us, below 1 us, and constant to 0.11 us. Both axes share the ADC clock: their
 * skew is that of two sampling switches, nanoseconds.
 *
 * 15 clocks of sampling suffice: behind the 10 nF filter capacitor the sampling capacitor (7 pF at most)
 * settles through the converter's own 6 kOhm with 42 ns, 16 time constants in 667 ns, and takes 0.07 % of the
 * difference between two consecutive readings of the same axis from the filter capacitor.
 *
 * The supply is measured meanwhile: eight times a second, just behind a tick, ADC1 converts the internal
 * reference once as an injected conversion (ADC2, simultaneous, its own channel: unused), which is over 22 us
 * later, long before the next trigger. It leaves the sampling capacitor of x at 1.2 V: the 0.07 % above of
 * half a volt, in one of eight conversions of that sample, is 0.04 mV, less than one code of 65536 against a
 * noise of 50.
 *
 * No software takes part, so interrupt latency cannot move a sample. A tick served more than 1000 us late is
 * marked; one whose half has been overwritten is counted as missed.
 */
#ifndef SAMPLING_H
#define SAMPLING_H

#include "clock.h"
#include "impid_core.h"

#define SAMPLING_TRIGGER_HZ     (IMPID_SAMPLE_RATE_HZ * IMPID_OVERSAMPLING)
#define SAMPLING_TRIGGER_CLOCKS (CLOCK_TIMER_HZ / SAMPLING_TRIGGER_HZ) /* from one to the next */

/* VDDA, which supplies the accelerometer, from the reference voltage: once before sampling_start(), which
 * goes on measuring it. */
void sampling_measure_supply(void);
/* Starts the time and the samples; from here on the tick interrupt calls the core. */
void sampling_start(impid_core_t *core);
/* Ticks served since start. */
uint32_t sampling_ticks(void);
/* What the last tick had of its own instant. */
typedef struct {
    uint32_t encoder[2];
    uint32_t codes; /* of x, and of y above */
} sampling_latest_t;
const volatile sampling_latest_t *sampling_latest(void);
/* For the bench test: from the next tick on TIM3 itself lets its output toggle once from trigger to trigger,
 * `clock` clocks after each, so that an edge stands where the hardware has its own zero. Eight edges are a
 * tick: just before the instant that ends it the line falls, wherever `clock` is. SAMPLING_TRIGGER_CLOCKS
 * lets go of the pin. false: `clock` is where the tick itself would disturb it; it must be below
 * SAMPLING_EDGE_EARLY or above SAMPLING_EDGE_LATE. */
#define SAMPLING_EDGE_EARLY 300u
#define SAMPLING_EDGE_LATE  (SAMPLING_TRIGGER_CLOCKS / 2u)
bool sampling_edge(uint32_t clock);
/* Adds the tick's part to the account. */
void sampling_health(impid_port_health_t *health);

#endif
