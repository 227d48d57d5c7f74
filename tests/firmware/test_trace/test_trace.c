#include "impid_trace.h"

#include <string.h>
#include <unity.h>

void setUp(void) {
}

void tearDown(void) {
}

static impid_trace_t trace;

static void expect(bool valid, uint32_t boot_id, uint32_t produced) {
    uint32_t boot = 99;
    uint32_t count = 99;
    TEST_ASSERT_EQUAL(valid, impid_trace_read(&trace, &boot, &count));
    TEST_ASSERT_EQUAL_UINT32(boot_id, boot);
    TEST_ASSERT_EQUAL_UINT32(produced, count);
}

static void test_a_mark_is_read_back(void) {
    const uint32_t counts[] = {0, 1, 65535, 65536, UINT32_MAX - 1u, UINT32_MAX};
    impid_trace_begin(&trace, 7);
    expect(true, 7, 0);
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        impid_trace_mark(&trace, counts[i]);
        expect(true, 7, counts[i]);
    }
}

static void test_a_reset_between_the_two_stores_costs_nothing(void) {
    impid_trace_begin(&trace, 7);
    impid_trace_mark(&trace, 41);
    trace.produced = 42;
    expect(true, 7, 42);
}

static void test_random_memory_is_no_trace(void) {
    uint32_t random = 1;
    for (uint32_t n = 0; n < 100000u; n++) {
        uint32_t words[IMPID_TRACE_WORDS];
        for (size_t i = 0; i < IMPID_TRACE_WORDS; i++) {
            random = random * 1664525u + 1013904223u;
            words[i] = random ^ (random >> 15);
        }
        words[0] &= 0xFFFFu;
        memcpy(&trace, words, sizeof trace);
        expect(false, 0, 0);
    }
}

static void test_any_flipped_bit_is_seen(void) {
    for (uint32_t bit = 0; bit < 8u * sizeof trace; bit++) {
        impid_trace_begin(&trace, 7);
        impid_trace_mark(&trace, 1000);
        uint8_t bytes[sizeof trace];
        memcpy(bytes, &trace, sizeof trace);
        bytes[bit / 8u] ^= (uint8_t)(1u << (bit % 8u));
        memcpy(&trace, bytes, sizeof trace);
        if (bit != 32u) { /* 1001 for 1000: what a reset between the stores looks like */
            expect(false, 0, 0);
        }
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_mark_is_read_back);
    RUN_TEST(test_a_reset_between_the_two_stores_costs_nothing);
    RUN_TEST(test_random_memory_is_no_trace);
    RUN_TEST(test_any_flipped_bit_is_seen);
    return UNITY_END();
}
