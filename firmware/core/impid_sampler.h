/* One sample per tick: the readings of all axes, filtered to one where the sensor does not do so itself,
 * paired with the encoder counts of the instant to which the value belongs.
 *
 * Data flow: the port calls impid_sampler_tick() with what the hardware latched; the sample goes into the
 * ring while the sampler runs. Sensor and filter delay the acceleration by the sensor's `delay_ticks`, so the
 * sample of tick k carries the encoder counts, the time and the event flags of so many ticks before: the
 * delay is taken off here, once.
 * Ownership: the state is the core's; the tick's data are read during the call only.
 * Concurrency: tick() and missed() run in the sampling interrupt. start() and stop() run in the main loop,
 * which the interrupt preempts but never the reverse. start() writes index, counters and ring only while
 * `running` is clear, when the interrupt touches none of them, and sets `running` last; after stop() has
 * cleared it, no later tick pushes.
 * Timing: at most 28 multiply-adds an axis and one copy a tick. Can fail: a full ring (counted there).
 *
 * Account: produced = samples popped from the ring + still in it + lost in it + overruns since start.
 */
#ifndef IMPID_SAMPLER_H
#define IMPID_SAMPLER_H

#include "impid_decimator.h"
#include "impid_ring.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define IMPID_OVERSAMPLING   8u /* readings a tick that the decimator is made for */
#define IMPID_SAMPLE_RATE_HZ 1000u
#define IMPID_PERIOD_US      1000u

#define IMPID_FLAG_SATURATED     0x01u /* a conversion in this sample's filter window at a rail */
#define IMPID_FLAG_ENCODER_FAULT 0x02u
#define IMPID_FLAG_LATE          0x04u /* the interrupt of this instant was served a period late */
#define IMPID_FLAG_RESET         0x08u /* first sample of the stream after boot: set by the main loop */
#define IMPID_FLAG_SYNC_EDGE     0x10u
#define IMPID_FLAG_FINE          0x20u /* ACCEL_FINE belongs to this sample: set on the way out */

typedef struct {
    const uint16_t *adc;  /* of a sensor with 8 readings: so many pairs x, y; the last pair at t_us */
    const uint32_t *wide; /* of a sensor with one: an unsigned number for each axis */
    uint32_t encoder[2];  /* latched at t_us */
    uint32_t t_us;        /* the trigger's instant */
    uint8_t flags;        /* IMPID_FLAG_ENCODER_FAULT, _LATE, _SYNC_EDGE of this tick */
} impid_tick_t;

typedef struct {
    uint32_t encoder[2];
    uint32_t t_us;
    uint8_t flags;
} impid_instant_t;

typedef struct {
    const impid_sensor_t *sensor;
    impid_ring_t ring;
    impid_decimator_t axis[2]; /* no sensor has three analog outputs yet */
    uint32_t reading[IMPID_AXES_MAX];
    uint8_t ticks; /* since the filters restarted, stops at the number of instants */
    impid_instant_t instants[IMPID_DELAY_TICKS_MAX + 1u];
    uint8_t newest; /* of the instants; the sample's own is `delay_ticks` before */
    uint32_t next_index;
    _Atomic bool running;
    _Atomic uint32_t produced;       /* samples since start, those lost included */
    _Atomic uint32_t overruns;       /* instants without a sample, since boot */
    _Atomic uint32_t late;           /* since boot */
    _Atomic uint32_t saturated;      /* samples since boot */
    _Atomic uint32_t encoder_faults; /* samples since boot */
} impid_sampler_t;

void impid_sampler_init(impid_sampler_t *sampler, const impid_sensor_t *sensor);
void impid_sampler_tick(impid_sampler_t *sampler, const impid_tick_t *tick);
/* The conversions of `ticks` ticks were overwritten before they were read. */
void impid_sampler_missed(impid_sampler_t *sampler, uint32_t ticks);
void impid_sampler_start(impid_sampler_t *sampler, uint32_t first_index);
void impid_sampler_stop(impid_sampler_t *sampler);
/* Forget what a stopped sampler has produced. */
void impid_sampler_discard(impid_sampler_t *sampler);

#endif
