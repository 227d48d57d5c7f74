/* From the sampling timer to the core's tick, with every instant set by hardware.
 *
 * TIM3 overflows every 125 us. Its trigger output starts both converters together and makes TIM2 and TIM5
 * copy their encoder counts; DMA carries all of it into memory, two halves of eight rows each: when one is
 * full, the tick interrupt hands it to the core while the other fills. The skew between counts and voltages,
 * which each chip has of its own, is derived in its converters.c.
 *
 * The supply is measured meanwhile: eight times a second, just behind a tick, ADC1 converts the internal
 * reference once as an injected conversion, which is over long before the next trigger.
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
