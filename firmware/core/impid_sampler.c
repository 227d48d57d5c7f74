#include "impid_sampler.h"

#include "impid_assert.h"

#include <string.h>

/* Counters have one writer, the interrupt: load and store need not be one operation. */
static void count(_Atomic uint32_t *counter, uint32_t more) {
    uint32_t value = atomic_load_explicit(counter, memory_order_relaxed);
    atomic_store_explicit(counter, value + more, memory_order_relaxed);
}

static void restart_filters(impid_sampler_t *sampler) {
    impid_decimator_init(&sampler->axis[0]);
    impid_decimator_init(&sampler->axis[1]);
}

void impid_sampler_init(impid_sampler_t *sampler) {
    memset(sampler, 0, sizeof *sampler);
    impid_ring_clear(&sampler->ring);
    restart_filters(sampler);
}

static void emit(impid_sampler_t *sampler, const impid_instant_t *instant) {
    impid_decimator_output_t x = impid_decimator_output(&sampler->axis[0]);
    impid_decimator_output_t y = impid_decimator_output(&sampler->axis[1]);
    uint8_t saturated = (x.saturated || y.saturated) ? IMPID_FLAG_SATURATED : 0u;
    impid_sample_t sample = {
        .index = sampler->next_index,
        .t_us = instant->t_us,
        .encoder = {instant->encoder[0], instant->encoder[1]},
        .accel = {x.code, y.code},
        .flags = (uint8_t)(instant->flags | saturated),
    };
    count(&sampler->saturated, saturated != 0u);
    count(&sampler->encoder_faults, (instant->flags & IMPID_FLAG_ENCODER_FAULT) != 0u);
    (void)impid_ring_push(&sampler->ring, &sample); /* the ring counts what it refuses */
}

void impid_sampler_tick(impid_sampler_t *sampler, const impid_tick_t *tick) {
    for (uint32_t i = 0; i < IMPID_OVERSAMPLING; i++) {
        impid_decimator_push(&sampler->axis[0], tick->adc[2u * i]);
        impid_decimator_push(&sampler->axis[1], tick->adc[2u * i + 1u]);
    }
    sampler->newest = (uint8_t)((sampler->newest + 1u) % (IMPID_DELAY_TICKS + 1u));
    sampler->instants[sampler->newest] = (impid_instant_t){
        .encoder = {tick->encoder[0], tick->encoder[1]}, .t_us = tick->t_us, .flags = tick->flags};
    count(&sampler->late, (tick->flags & IMPID_FLAG_LATE) != 0u);

    if (!atomic_load_explicit(&sampler->running, memory_order_acquire)) {
        return;
    }
    IMPID_ASSERT(impid_decimator_ready(&sampler->axis[0]) == impid_decimator_ready(&sampler->axis[1]));
    if (impid_decimator_ready(&sampler->axis[0])) {
        emit(sampler, &sampler->instants[(sampler->newest + 1u) % (IMPID_DELAY_TICKS + 1u)]);
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
