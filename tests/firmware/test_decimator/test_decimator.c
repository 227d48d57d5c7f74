#include "impid_decimator.h"

#include <math.h>
#include <unity.h>

#define RAIL 4095u /* 12 bits */

void setUp(void) {
}

void tearDown(void) {
}

static const double pi = 3.14159265358979323846;

static impid_decimator_output_t settled(uint16_t code) {
    impid_decimator_t decimator;
    impid_decimator_init(&decimator);
    for (uint32_t i = 0; i < IMPID_DECIMATOR_TAPS; i++) {
        impid_decimator_push(&decimator, code, RAIL);
    }
    return impid_decimator_output(&decimator, 12);
}

static void test_constant_input_gives_sixteen_times_the_code(void) {
    for (uint16_t code = 0; code <= RAIL; code++) {
        TEST_ASSERT_EQUAL_UINT16(16u * code, settled(code).code);
    }
}

/* Deviation of the output from mid-scale `lag` conversions after one conversion of 2000 codes more. */
static int32_t impulse_response(uint32_t lag) {
    impid_decimator_t decimator;
    impid_decimator_init(&decimator);
    for (uint32_t i = 0; i < 64u; i++) {
        impid_decimator_push(&decimator, 2000, RAIL);
    }
    impid_decimator_push(&decimator, 4000, RAIL);
    for (uint32_t i = 0; i < lag; i++) {
        impid_decimator_push(&decimator, 2000, RAIL);
    }
    return (int32_t)impid_decimator_output(&decimator, 12).code - 32000;
}

static void test_impulse_response_is_symmetric_and_28_long(void) {
    int32_t sum = 0;
    for (uint32_t lag = 0; lag < IMPID_DECIMATOR_TAPS; lag++) {
        TEST_ASSERT_EQUAL_INT32(impulse_response(IMPID_DECIMATOR_TAPS - 1u - lag), impulse_response(lag));
        sum += impulse_response(lag);
    }
    TEST_ASSERT_EQUAL_INT32(0, impulse_response(IMPID_DECIMATOR_TAPS));
    TEST_ASSERT_INT32_WITHIN(14, 32000, sum); /* 28 roundings of half a code */
}

/* Amplitude and delay of a tone behind the filter, measured by correlating with sine and cosine. */
static void tone(double hertz, double *gain, double *delay_us) {
    impid_decimator_t decimator;
    impid_decimator_init(&decimator);
    double in_phase = 0;
    double quadrature = 0;
    const uint32_t count = 8000;
    for (uint32_t n = 0; n < count + 80u; n++) {
        double phase = 2 * pi * hertz * n / 8000.0;
        impid_decimator_push(&decimator, (uint16_t)lround(2048 + 1500 * sin(phase)), RAIL);
        if (n >= 80u) {
            double out = impid_decimator_output(&decimator, 12).code / 16.0 - 2048;
            in_phase += out * sin(phase) * 2 / count;
            quadrature += out * cos(phase) * 2 / count;
        }
    }
    *gain = hypot(in_phase, quadrature) / 1500;
    *delay_us = -atan2(quadrature, in_phase) / (2 * pi * hertz) * 1e6;
}

/* |H| from the definition of an even symmetric filter: 2 sum h[m] cos(w (m + 1/2)). */
static double amplitude(double hertz) {
    static const int32_t taps[IMPID_DECIMATOR_TAPS] = {IMPID_DECIMATOR_TAP_VALUES};
    double sum = 0;
    for (uint32_t m = 0; m < 14u; m++) {
        sum += 2.0 * taps[14u + m] * cos(2 * pi * hertz / 8000 * (m + 0.5));
    }
    return fabs(sum) / 65536;
}

static void test_tones_are_passed_with_the_designed_gain_and_delayed_by_1687_us(void) {
    const double hertz[] = {1, 5, 15, 30, 60, 150};
    for (uint32_t i = 0; i < sizeof hertz / sizeof hertz[0]; i++) {
        double gain;
        double delay;
        tone(hertz[i], &gain, &delay);
        TEST_ASSERT_TRUE(fabs(gain - amplitude(hertz[i])) <
                         1e-4); /* 12-bit rounding of a tone repeats with it */
        TEST_ASSERT_TRUE(fabs(delay - 1687.5) < 1e-4 / (2 * pi * hertz[i]) * 1e6);
    }
}

static void test_what_would_alias_into_the_motion_is_stopped(void) {
    const double hertz[] = {941, 985, 1000, 1015, 1059, 1985, 2000, 2015, 3000, 3900};
    for (uint32_t i = 0; i < sizeof hertz / sizeof hertz[0]; i++) {
        double gain;
        double delay;
        tone(hertz[i], &gain, &delay);
        TEST_ASSERT_TRUE(gain < 1.55e-3); /* -56 dB */
    }
    double gain;
    double delay;
    tone(15, &gain, &delay);
    TEST_ASSERT_TRUE(fabs(20 * log10(gain)) < 0.002);
}

static void test_rails_are_flagged_for_as_long_as_they_matter(void) {
    const uint16_t rails[] = {0, RAIL};
    for (uint32_t r = 0; r < 2u; r++) {
        impid_decimator_t decimator;
        impid_decimator_init(&decimator);
        impid_decimator_push(&decimator, rails[r], RAIL);
        for (uint32_t i = 1; i < IMPID_DECIMATOR_TAPS; i++) {
            TEST_ASSERT_TRUE(impid_decimator_output(&decimator, 12).saturated);
            TEST_ASSERT_FALSE(impid_decimator_ready(&decimator));
            impid_decimator_push(&decimator, 2048, RAIL);
        }
        TEST_ASSERT_TRUE(impid_decimator_ready(&decimator));
        TEST_ASSERT_TRUE(impid_decimator_output(&decimator, 12).saturated);
        impid_decimator_push(&decimator, 2048, RAIL);
        TEST_ASSERT_FALSE(impid_decimator_output(&decimator, 12).saturated);
    }
}

/* A step between the codes next to the rails overshoots: the output is clipped, and says so. */
static void test_overshoot_is_clipped_and_flagged(void) {
    impid_decimator_t decimator;
    impid_decimator_init(&decimator);
    for (uint32_t i = 0; i < 64u; i++) {
        impid_decimator_push(&decimator, 1, RAIL);
    }
    uint32_t low = 0;
    uint32_t high = 0;
    for (uint32_t i = 0; i < 64u; i++) {
        impid_decimator_push(&decimator, RAIL - 1u, RAIL);
        impid_decimator_output_t output = impid_decimator_output(&decimator, 12);
        TEST_ASSERT_EQUAL(output.code == 0u || output.code == UINT16_MAX, output.saturated);
        low += output.code == 0u;
        high += output.code == UINT16_MAX;
    }
    TEST_ASSERT_GREATER_THAN_UINT32(0, low);
    TEST_ASSERT_GREATER_THAN_UINT32(0, high);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_constant_input_gives_sixteen_times_the_code);
    RUN_TEST(test_impulse_response_is_symmetric_and_28_long);
    RUN_TEST(test_tones_are_passed_with_the_designed_gain_and_delayed_by_1687_us);
    RUN_TEST(test_what_would_alias_into_the_motion_is_stopped);
    RUN_TEST(test_rails_are_flagged_for_as_long_as_they_matter);
    RUN_TEST(test_overshoot_is_clipped_and_flagged);
    return UNITY_END();
}
