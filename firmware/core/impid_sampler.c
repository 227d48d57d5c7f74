#include "impid_sampler.h"

#include "impid_assert.h"

#include <string.h>

#define INSTANTS (IMPID_DELAY_TICKS_MAX + 1u)

/* Counters have one writer, the interrupt: load and store need not be one operation. */
static void count(_Atomic uint32_t *counter, uint32_t more) {
    uint32_t value = atomic_load_explicit(counter, memory_order_relaxed);
    atomic_store_explicit(counter, value + more, memory_order_relaxed);
}

static void restart_filters(impid_sampler_t *sampler) {
    impid_decimator_init(&sampler->axis[0]);
    impid_decimator_init(&sampler->axis[1]);
    sampler->ticks = 0u;
}

void impid_sampler_init(impid_sampler_t *sampler, const impid_sensor_t *sensor) {
    memset(sampler, 0, sizeof *sampler);
    sampler->sensor = sensor;
    impid_ring_clear(&sampler->ring);
    restart_filters(sampler);
}

static bool filtered(const impid_sensor_t *sensor) {
    return sensor->readings == IMPID_OVERSAMPLING;
}

static void take_readings(impid_sampler_t *sampler, const impid_tick_t *tick) {
    const impid_sensor_t *sensor = sampler->sensor;
    if (filtered(sensor)) {
        /* Read once: the compiler cannot know that the history's bytes are not these. */
        const uint16_t *adc = tick->adc;
        uint32_t rail = sensor->reading_max;
        for (uint32_t i = 0; i < IMPID_OVERSAMPLING; i++) {
            impid_decimator_push(&sampler->axis[0], adc[2u * i], rail);
            impid_decimator_push(&sampler->axis[1], adc[2u * i + 1u], rail);
        }
    } else {
        for (uint32_t i = 0; i < IMPID_AXES_MAX && i < sensor->axes; i++) {
            sampler->reading[i] = tick->wide[i];
        }
    }
}

/* The sample's own instant lies behind the last restart, as does the whole of the filter's window. */
static bool ready(const impid_sampler_t *sampler) {
    return sampler->ticks > sampler->sensor->delay_ticks &&
           (!filtered(sampler->sensor) || impid_decimator_ready(&sampler->axis[0]));
}

/* The codes of all axes into the sample; true if one is at a rail. */
static bool give_codes(const impid_sampler_t *sampler, impid_sample_t *sample) {
    const impid_sensor_t *sensor = sampler->sensor;
    bool saturated = false;
    for (uint32_t i = 0; i < IMPID_AXES_MAX && i < sensor->axes; i++) {
        if (filtered(sensor)) {
            impid_decimator_output_t output = impid_decimator_output(&sampler->axis[i], sensor->reading_bits);
            sample->accel[i] = output.code;
            saturated = saturated || output.saturated;
        } else {
            uint32_t code = sampler->reading[i] << (24u - sensor->reading_bits);
            sample->accel[i] = (uint16_t)(code >> 8);
            sample->fine[i] = (uint8_t)code;
            saturated = saturated || sampler->reading[i] == 0u || sampler->reading[i] >= sensor->reading_max;
        }
    }
    return saturated;
}

static void emit(impid_sampler_t *sampler, const impid_instant_t *instant) {
    impid_sample_t sample = {
        .index = sampler->next_index,
        .t_us = instant->t_us,
        .encoder = {instant->encoder[0], instant->encoder[1]},
        .flags = instant->flags,
    };
    if (give_codes(sampler, &sample)) {
        sample.flags |= IMPID_FLAG_SATURATED;
        count(&sampler->saturated, 1u);
    }
    count(&sampler->encoder_faults, (instant->flags & IMPID_FLAG_ENCODER_FAULT) != 0u);
    (void)impid_ring_push(&sampler->ring, &sample); /* the ring counts what it refuses */
}

void impid_sampler_tick(impid_sampler_t *sampler, const impid_tick_t *tick) {
    take_readings(sampler, tick);
    sampler->newest = (uint8_t)((sampler->newest + 1u) % INSTANTS);
    sampler->ticks = sampler->ticks < INSTANTS ? (uint8_t)(sampler->ticks + 1u) : sampler->ticks;
    sampler->instants[sampler->newest] = (impid_instant_t){
        .encoder = {tick->encoder[0], tick->encoder[1]}, .t_us = tick->t_us, .flags = tick->flags};
    count(&sampler->late, (tick->flags & IMPID_FLAG_LATE) != 0u);

    if (!atomic_load_explicit(&sampler->running, memory_order_acquire)) {
        return;
    }
    IMPID_ASSERT(!filtered(sampler->sensor) ||
                 impid_decimator_ready(&sampler->axis[0]) == impid_decimator_ready(&sampler->axis[1]));
    if (ready(sampler)) {
        emit(sampler,
             &sampler->instants[(sampler->newest + INSTANTS - sampler->sensor->delay_ticks) % INSTANTS]);
    } else if (atomic_load_explicit(&sampler->produced, memory_order_relaxed) > 0u) {
        count(&sampler->overruns, 1u); /* the window refills after missed ticks: this instant has no sample */
    } else {
        return; /* started within the first ticks after boot: the stream begins with the first full window */
    }
    sampler->next_index++;
    count(&sampler->produced, 1u);
}

void impid_sampler_missed(impid_sampler_t *sampler, uint32_t ticks) {
    restart_filters(sampler);
    count(&sampler->overruns, ticks);
    if (atomic_load_explicit(&sampler->running, memory_order_acquire) &&
        atomic_load_explicit(&sampler->produced, memory_order_relaxed) > 0u) {
        sampler->next_index += ticks;
        count(&sampler->produced, ticks);
    }
}

void impid_sampler_start(impid_sampler_t *sampler, uint32_t first_index) {
    impid_sampler_discard(sampler);
    sampler->next_index = first_index;
    atomic_store_explicit(&sampler->running, true, memory_order_release);
}

void impid_sampler_stop(impid_sampler_t *sampler) {
    atomic_store_explicit(&sampler->running, false, memory_order_release);
}

void impid_sampler_discard(impid_sampler_t *sampler) {
    impid_ring_clear(&sampler->ring);
    atomic_store_explicit(&sampler->produced, 0u, memory_order_relaxed);
}
