#include "impid_sampler.h"

#include <unity.h>

static impid_sampler_t sampler;
static uint32_t tick_number;

/* Tick k: x alternates around 1000, encoders tell the tick, time is 1000 k. */
static void tick(uint16_t x, uint8_t flags) {
    uint16_t adc[2u * IMPID_OVERSAMPLING];
    for (uint32_t i = 0; i < IMPID_OVERSAMPLING; i++) {
        adc[2u * i] = x;
        adc[2u * i + 1u] = 3000;
    }
    impid_tick_t now = {
        .adc = adc, .encoder = {tick_number, 0u - tick_number}, .t_us = 1000u * tick_number, .flags = flags};
    impid_sampler_tick(&sampler, &now);
    tick_number++;
}

void setUp(void) {
    impid_sampler_init(&sampler, &impid_adxl203);
    tick_number = 0;
}

void tearDown(void) {
}

static void test_nothing_is_sampled_before_start(void) {
    for (uint32_t i = 0; i < 10u; i++) {
        tick(1000, 0);
    }
    impid_sample_t sample;
    TEST_ASSERT_FALSE(impid_ring_pop(&sampler.ring, &sample));
    TEST_ASSERT_EQUAL_UINT32(0, sampler.produced);
}

static void test_sample_carries_encoders_time_and_flags_of_two_ticks_before(void) {
    impid_sampler_start(&sampler, 7);
    for (uint32_t i = 0; i < 10u; i++) {
        tick(1000, i == 5u ? IMPID_FLAG_ENCODER_FAULT | IMPID_FLAG_SYNC_EDGE : 0u);
    }
    impid_sample_t sample;
    /* The first full window of 28 conversions is there at tick 3. */
    for (uint32_t k = 3; k < 10u; k++) {
        TEST_ASSERT_TRUE(impid_ring_pop(&sampler.ring, &sample));
        TEST_ASSERT_EQUAL_UINT32(7u + k - 3u, sample.index);
        TEST_ASSERT_EQUAL_UINT32(1000u * (k - 2u), sample.t_us);
        TEST_ASSERT_EQUAL_UINT32(k - 2u, sample.encoder[0]);
        TEST_ASSERT_EQUAL_UINT32(0u - (k - 2u), sample.encoder[1]);
        TEST_ASSERT_EQUAL_UINT16(16000, sample.accel[0]);
        TEST_ASSERT_EQUAL_UINT16(48000, sample.accel[1]);
        TEST_ASSERT_EQUAL_HEX8(k - 2u == 5u ? IMPID_FLAG_ENCODER_FAULT | IMPID_FLAG_SYNC_EDGE : 0u,
                               sample.flags);
    }
    TEST_ASSERT_EQUAL_UINT32(7, sampler.produced);
    TEST_ASSERT_EQUAL_UINT32(1, sampler.encoder_faults);
}

/* An acceleration step at tick 20 passes half its height at the very instant whose encoders the sample
 * carries: between tick 19.94 and 20 the conversions change, so the crossing lies in samples 19 and 20. */
static void test_acceleration_and_encoders_of_one_sample_belong_together(void) {
    impid_sampler_start(&sampler, 0);
    impid_sample_t sample;
    uint32_t below = 0;
    uint32_t above = 0;
    for (uint32_t k = 0; k < 40u; k++) {
        tick(k < 20u ? 1000 : 2000, 0);
        if (impid_ring_pop(&sampler.ring, &sample)) {
            below = sample.accel[0] < 24000u ? sample.encoder[0] : below;
            above = above == 0u && sample.accel[0] > 24000u ? sample.encoder[0] : above;
        }
    }
    /* The step lies 7.5 conversions before tick 20, at 19.06, and 0.3 ms of the delay are the sensor's. */
    TEST_ASSERT_EQUAL_UINT32(19, above);
    TEST_ASSERT_EQUAL_UINT32(18, below);
}

static void test_full_ring_is_counted_and_the_index_goes_on(void) {
    impid_sampler_start(&sampler, UINT32_MAX - 100u);
    for (uint32_t i = 0; i < 3u + IMPID_RING_SAMPLES + 50u; i++) {
        tick(1000, 0);
    }
    TEST_ASSERT_EQUAL_UINT32(50, impid_ring_lost(&sampler.ring));
    TEST_ASSERT_EQUAL_UINT32(IMPID_RING_SAMPLES + 50u, sampler.produced);
    impid_sample_t sample;
    while (impid_ring_pop(&sampler.ring, &sample)) {
    }
    uint32_t last = sample.index;
    tick(1000, 0);
    TEST_ASSERT_TRUE(impid_ring_pop(&sampler.ring, &sample));
    TEST_ASSERT_EQUAL_UINT32(last + 51u, sample.index);
}

/* Missed ticks: their instants own indices, as do those in which the filter's window refills. */
static void test_missed_ticks_leave_a_gap_of_the_right_length(void) {
    impid_sampler_start(&sampler, 0);
    for (uint32_t i = 0; i < 10u; i++) {
        tick(1000, 0);
    }
    impid_sampler_missed(&sampler, 5);
    tick_number += 5;
    for (uint32_t i = 0; i < 10u; i++) {
        tick(1000, 0);
    }
    impid_sample_t sample;
    uint32_t delivered = 0;
    while (impid_ring_pop(&sampler.ring, &sample)) {
        /* Index and time stay on one line through the gap. */
        TEST_ASSERT_EQUAL_UINT32(1000u * (sample.index + 1u), sample.t_us);
        TEST_ASSERT_EQUAL_UINT16(16000, sample.accel[0]);
        delivered++;
    }
    TEST_ASSERT_EQUAL_UINT32(5u + 3u, sampler.overruns);
    TEST_ASSERT_EQUAL_UINT32(sampler.produced, delivered + sampler.overruns);
}

/* Without a stream, missed ticks are counted but own no index; a stream then begins with a full window. */
static void test_missed_ticks_outside_a_stream_shift_no_index(void) {
    for (uint32_t i = 0; i < 10u; i++) {
        tick(1000, 0);
    }
    impid_sampler_missed(&sampler, 4);
    impid_sampler_start(&sampler, 0);
    impid_sampler_missed(&sampler, 3);
    TEST_ASSERT_EQUAL_UINT32(0, sampler.produced);
    for (uint32_t i = 0; i < 4u; i++) {
        tick(1000, 0);
    }
    impid_sample_t sample;
    TEST_ASSERT_TRUE(impid_ring_pop(&sampler.ring, &sample));
    TEST_ASSERT_EQUAL_UINT32(0, sample.index);
    TEST_ASSERT_EQUAL_UINT16(16000, sample.accel[0]);
    TEST_ASSERT_FALSE(impid_ring_pop(&sampler.ring, &sample));
    TEST_ASSERT_EQUAL_UINT32(7, sampler.overruns);
}

static void test_a_rail_on_either_axis_flags_the_sample(void) {
    impid_sampler_start(&sampler, 0);
    uint16_t adc[2u * IMPID_OVERSAMPLING];
    for (uint32_t i = 0; i < IMPID_OVERSAMPLING; i++) {
        adc[2u * i] = 1000;
        adc[2u * i + 1u] = 0;
    }
    impid_tick_t at_rail = {.adc = adc};
    for (uint32_t i = 0; i < 4u; i++) {
        impid_sampler_tick(&sampler, &at_rail);
    }
    impid_sample_t sample;
    TEST_ASSERT_TRUE(impid_ring_pop(&sampler.ring, &sample));
    TEST_ASSERT_EQUAL_HEX8(IMPID_FLAG_SATURATED, sample.flags);
}

static void test_late_and_saturated_are_counted(void) {
    impid_sampler_start(&sampler, 0);
    for (uint32_t i = 0; i < 30u; i++) {
        tick(i == 10u ? 4095u : 1000, i == 20u ? IMPID_FLAG_LATE : 0u);
    }
    /* Conversions 80..87 at the rail touch the windows that end at 87, 95, 103 and 111. */
    TEST_ASSERT_EQUAL_UINT32(4, sampler.saturated);
    TEST_ASSERT_EQUAL_UINT32(1, sampler.late);
    impid_sample_t sample;
    uint32_t late_at = 0;
    while (impid_ring_pop(&sampler.ring, &sample)) {
        late_at = (sample.flags & IMPID_FLAG_LATE) ? sample.encoder[0] : late_at;
    }
    TEST_ASSERT_EQUAL_UINT32(20, late_at);
}

static void test_restart_begins_anew(void) {
    impid_sampler_start(&sampler, 0);
    for (uint32_t i = 0; i < 300u; i++) {
        tick(1000, 0);
    }
    impid_sampler_stop(&sampler);
    tick(1000, 0);
    TEST_ASSERT_EQUAL_UINT32(297, sampler.produced);
    impid_sampler_start(&sampler, 5);
    TEST_ASSERT_EQUAL_UINT32(0, impid_ring_lost(&sampler.ring));
    tick(1000, 0);
    impid_sample_t sample;
    TEST_ASSERT_TRUE(impid_ring_pop(&sampler.ring, &sample));
    TEST_ASSERT_EQUAL_UINT32(5, sample.index);
    TEST_ASSERT_EQUAL_UINT32(1, sampler.produced);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_sampled_before_start);
    RUN_TEST(test_sample_carries_encoders_time_and_flags_of_two_ticks_before);
    RUN_TEST(test_acceleration_and_encoders_of_one_sample_belong_together);
    RUN_TEST(test_full_ring_is_counted_and_the_index_goes_on);
    RUN_TEST(test_missed_ticks_leave_a_gap_of_the_right_length);
    RUN_TEST(test_missed_ticks_outside_a_stream_shift_no_index);
    RUN_TEST(test_a_rail_on_either_axis_flags_the_sample);
    RUN_TEST(test_late_and_saturated_are_counted);
    RUN_TEST(test_restart_begins_anew);
    return UNITY_END();
}
