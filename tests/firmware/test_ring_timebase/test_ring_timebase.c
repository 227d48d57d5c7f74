#include "impid_ring.h"
#include "impid_timebase.h"

#include <unity.h>

void setUp(void) {
}

void tearDown(void) {
}

static impid_ring_t ring;

static void test_what_goes_in_comes_out_in_order_and_the_rest_is_counted(void) {
    impid_ring_clear(&ring);
    for (uint32_t i = 0; i < IMPID_RING_SAMPLES + 37u; i++) {
        impid_sample_t in = {.index = i};
        TEST_ASSERT_EQUAL(i < IMPID_RING_SAMPLES, impid_ring_push(&ring, &in));
    }
    TEST_ASSERT_EQUAL_UINT32(37, impid_ring_lost(&ring));
    impid_sample_t out;
    for (uint32_t i = 0; i < IMPID_RING_SAMPLES; i++) {
        TEST_ASSERT_TRUE(impid_ring_pop(&ring, &out));
        TEST_ASSERT_EQUAL_UINT32(i, out.index);
    }
    TEST_ASSERT_FALSE(impid_ring_pop(&ring, &out));
    TEST_ASSERT_EQUAL_UINT32(37, impid_ring_lost(&ring));
}

/* Whatever the pattern of pushes and pops: taken = delivered + waiting + lost. */
static void test_account_holds_for_any_interleaving_across_the_wrap_of_the_indices(void) {
    impid_ring_clear(&ring);
    atomic_store(&ring.head, UINT32_MAX - 1000u);
    atomic_store(&ring.tail, UINT32_MAX - 1000u);
    uint32_t random = 1;
    uint32_t tried = 0;
    uint32_t popped = 0;
    uint32_t waiting = 0;
    uint32_t expected = 0; /* a model: indices still in the ring are contiguous except where refused */
    impid_sample_t sample = {0};
    for (uint32_t step = 0; step < 100000u; step++) {
        random = random * 1664525u + 1013904223u;
        if ((random >> 16) % 100u < (step / 5000u % 2u ? 45u : 60u)) {
            sample.index = tried++;
            waiting += impid_ring_push(&ring, &sample);
        } else if (impid_ring_pop(&ring, &sample)) {
            TEST_ASSERT_GREATER_OR_EQUAL_UINT32(expected, sample.index);
            expected = sample.index + 1u;
            popped++;
            waiting--;
        }
        TEST_ASSERT_EQUAL_UINT32(tried, popped + waiting + impid_ring_lost(&ring));
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(IMPID_RING_SAMPLES, waiting);
    }
    TEST_ASSERT_GREATER_THAN_UINT32(0, impid_ring_lost(&ring));
}

static void test_timebase_counts_on_through_many_wraps(void) {
    impid_timebase_t timebase;
    uint64_t truth = 0x1FFFFFFF0ull;
    impid_timebase_init(&timebase, truth);
    for (uint32_t i = 0; i < 20u; i++) {
        truth += 0x7FFFFFFFull;
        TEST_ASSERT_EQUAL_UINT64(truth, impid_timebase_extend(&timebase, (uint32_t)truth));
    }
}

static void test_timebase_accepts_stamps_older_than_the_last_across_a_wrap(void) {
    impid_timebase_t timebase;
    impid_timebase_init(&timebase, 0xFFFFFFF0ull);
    TEST_ASSERT_EQUAL_UINT64(0x100000010ull, impid_timebase_extend(&timebase, 0x10u));
    TEST_ASSERT_EQUAL_UINT64(0xFFFFFFFFull, impid_timebase_extend(&timebase, 0xFFFFFFFFu));
    TEST_ASSERT_EQUAL_UINT64(0x100000011ull, impid_timebase_extend(&timebase, 0x11u));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_what_goes_in_comes_out_in_order_and_the_rest_is_counted);
    RUN_TEST(test_account_holds_for_any_interleaving_across_the_wrap_of_the_indices);
    RUN_TEST(test_timebase_counts_on_through_many_wraps);
    RUN_TEST(test_timebase_accepts_stamps_older_than_the_last_across_a_wrap);
    return UNITY_END();
}
