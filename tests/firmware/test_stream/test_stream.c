#include "fake_port.h"
#include "impid_stream.h"

#include <string.h>
#include <unity.h>

static fake_port_t fake;
static impid_stream_t stream;
static impid_link_t links[IMPID_CARRIERS];

void setUp(void) {
    fake_port_init(&fake);
    memset(links, 0, sizeof links);
    impid_stream_init(&stream, 99, 100, false);
    impid_stream_begin(&stream, 100);
}

void tearDown(void) {
}

static void feed(uint32_t index, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        impid_sample_t sample = {
            .index = index + i, .encoder = {0xF0000000u | i, 0x0FFFFFFFu}, .accel = {1, 2}};
        impid_stream_sample(&stream, &sample, 5000000u + 1000u * (sample.index - 100u), links, &fake.port);
    }
}

static void test_ten_samples_make_a_batch(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(100, 9);
    TEST_ASSERT_EQUAL_UINT32(0, fake.frames);
    feed(109, 11);
    TEST_ASSERT_EQUAL_UINT32(2, fake.frames);
    for (uint32_t i = 0; i < 2u; i++) {
        TEST_ASSERT_EQUAL_UINT8(10, fake.headers[i].count);
        TEST_ASSERT_EQUAL_UINT32(100u + 10u * i, fake.headers[i].first_index);
        TEST_ASSERT_EQUAL_UINT64(5000000u + 10000u * i, fake.headers[i].t0_us);
        TEST_ASSERT_EQUAL_UINT16(i, fake.headers[i].frame_seq);
        TEST_ASSERT_EQUAL_UINT16(99, fake.headers[i].boot_id);
        TEST_ASSERT_EQUAL_UINT8(0, fake.headers[i].flags);
    }
    TEST_ASSERT_EQUAL_UINT32(0, fake.can_frames);
}

static void test_a_gap_closes_the_batch_and_is_announced(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(100, 4);
    feed(110, 10);
    TEST_ASSERT_EQUAL_UINT32(2, fake.frames);
    TEST_ASSERT_EQUAL_UINT8(4, fake.headers[0].count);
    TEST_ASSERT_EQUAL_UINT8(0, fake.headers[0].flags);
    TEST_ASSERT_EQUAL_UINT32(110, fake.headers[1].first_index);
    TEST_ASSERT_EQUAL_UINT8(IMPID_BATCH_FLAG_GAP, fake.headers[1].flags);
    TEST_ASSERT_EQUAL_UINT8(10, fake.headers[1].count);
}

static void test_samples_that_follow_in_index_but_not_in_time_are_not_one_batch(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(100, 3);
    impid_sample_t sample = {.index = 103};
    impid_stream_sample(&stream, &sample, 5003001u, links, &fake.port);
    TEST_ASSERT_EQUAL_UINT32(1, fake.frames);
    TEST_ASSERT_EQUAL_UINT8(3, fake.headers[0].count);
}

static void test_a_lost_first_sample_is_a_gap_too(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(101, 10);
    TEST_ASSERT_EQUAL_UINT8(IMPID_BATCH_FLAG_GAP, fake.headers[0].flags);
}

static void test_what_waited_20_ms_or_is_left_at_the_end_is_sent(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(100, 3);
    impid_stream_flush_aged(&stream, 5000000u + IMPID_BATCH_AGE_US - 1u, links, &fake.port);
    TEST_ASSERT_EQUAL_UINT32(0, fake.frames);
    impid_stream_flush_aged(&stream, 5000000u + IMPID_BATCH_AGE_US, links, &fake.port);
    TEST_ASSERT_EQUAL_UINT32(1, fake.frames);
    feed(103, 2);
    impid_stream_leave(&stream, IMPID_CARRIER_SERIAL, links, &fake.port);
    TEST_ASSERT_EQUAL_UINT32(2, fake.frames);
    TEST_ASSERT_EQUAL_UINT8(2, fake.headers[1].count);
    TEST_ASSERT_EQUAL_UINT8(0, fake.headers[1].flags);
}

static void test_only_the_first_sample_after_boot_says_reset(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(100, 10);
    struct impid_messages_accel_t accel;
    for (uint32_t i = 0; i < 10u; i++) {
        (void)impid_messages_accel_unpack(&accel, &fake.records[0][i * IMPID_RECORD_SAMPLE], 8);
        TEST_ASSERT_EQUAL_HEX8(i == 0u ? IMPID_FLAG_RESET : 0u, accel.flags);
    }
    impid_stream_begin(&stream, 100);
    feed(100, 10);
    (void)impid_messages_accel_unpack(&accel, fake.records[1], 8);
    TEST_ASSERT_EQUAL_HEX8(0, accel.flags);
}

static void test_encoders_use_all_their_32_bits(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    feed(100, 10);
    struct impid_messages_accel_t accel;
    struct impid_messages_encoder_t encoder;
    (void)impid_messages_accel_unpack(&accel, &fake.records[0][3u * IMPID_RECORD_SAMPLE], 8);
    (void)impid_messages_encoder_unpack(&encoder, &fake.records[0][3u * IMPID_RECORD_SAMPLE + 8u], 8);
    TEST_ASSERT_EQUAL_HEX8(0xF, accel.enc1_high4);
    TEST_ASSERT_EQUAL_HEX32(3, encoder.enc1_low28);
    TEST_ASSERT_EQUAL_HEX8(0, accel.enc2_high4);
    TEST_ASSERT_EQUAL_HEX32(0x0FFFFFFF, encoder.enc2_low28);
}

static void test_can_sends_time_and_epoch_first_and_every_hundredth_sample(void) {
    impid_stream_join(&stream, IMPID_CARRIER_CAN);
    feed(100, 201);
    TEST_ASSERT_EQUAL_UINT32(2u * 201u + 2u * 3u, fake.can_frames);
    const uint32_t at[] = {0, 202, 404};
    for (uint32_t i = 0; i < 3u; i++) {
        struct impid_messages_time_t time;
        struct impid_messages_epoch_t epoch;
        TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_TIME_FRAME_ID, fake.can[at[i]].id);
        TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_EPOCH_FRAME_ID, fake.can[at[i] + 1u].id);
        TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_ACCEL_FRAME_ID, fake.can[at[i] + 2u].id);
        TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_ENCODER_FRAME_ID, fake.can[at[i] + 3u].id);
        (void)impid_messages_time_unpack(&time, fake.can[at[i]].data, 8);
        (void)impid_messages_epoch_unpack(&epoch, fake.can[at[i] + 1u].data, 8);
        TEST_ASSERT_EQUAL_UINT64(5000000u + 100000u * i, time.t_us);
        TEST_ASSERT_EQUAL_UINT32(100u + 100u * i, epoch.index);
        TEST_ASSERT_EQUAL_UINT16(99, epoch.boot_id);
    }
    TEST_ASSERT_EQUAL_UINT32(0, fake.frames);
}

static void test_what_the_carrier_refuses_is_counted_and_its_number_used_up(void) {
    impid_stream_join(&stream, IMPID_CARRIER_SERIAL);
    impid_stream_join(&stream, IMPID_CARRIER_CAN);
    fake.refuse = true;
    feed(100, 10);
    TEST_ASSERT_EQUAL_UINT32(1, links[IMPID_CARRIER_SERIAL].frames_dropped);
    /* The time base is tried again with each sample: 10 times 4 frames. */
    TEST_ASSERT_EQUAL_UINT32(40, links[IMPID_CARRIER_CAN].frames_dropped);
    fake.refuse = false;
    feed(110, 10);
    TEST_ASSERT_EQUAL_UINT16(1, fake.headers[0].frame_seq);
    TEST_ASSERT_EQUAL_UINT32(1, links[IMPID_CARRIER_SERIAL].frames_sent);
    TEST_ASSERT_EQUAL_UINT32(22, links[IMPID_CARRIER_CAN].frames_sent);
    TEST_ASSERT_EQUAL_HEX16(IMPID_MESSAGES_TIME_FRAME_ID, fake.can[0].id);
}

static void test_half_a_time_base_is_sent_again_whole(void) {
    impid_stream_join(&stream, IMPID_CARRIER_CAN);
    fake.can_room_after = 1; /* TIME finds no room, EPOCH does */
    feed(100, 2);
    const uint16_t ids[] = {IMPID_MESSAGES_EPOCH_FRAME_ID,   IMPID_MESSAGES_ACCEL_FRAME_ID,
                            IMPID_MESSAGES_ENCODER_FRAME_ID, IMPID_MESSAGES_TIME_FRAME_ID,
                            IMPID_MESSAGES_EPOCH_FRAME_ID,   IMPID_MESSAGES_ACCEL_FRAME_ID,
                            IMPID_MESSAGES_ENCODER_FRAME_ID};
    TEST_ASSERT_EQUAL_UINT32(7, fake.can_frames);
    for (uint32_t i = 0; i < 7u; i++) {
        TEST_ASSERT_EQUAL_HEX16(ids[i], fake.can[i].id);
    }
    TEST_ASSERT_EQUAL_UINT32(1, links[IMPID_CARRIER_CAN].frames_dropped);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_ten_samples_make_a_batch);
    RUN_TEST(test_a_gap_closes_the_batch_and_is_announced);
    RUN_TEST(test_samples_that_follow_in_index_but_not_in_time_are_not_one_batch);
    RUN_TEST(test_a_lost_first_sample_is_a_gap_too);
    RUN_TEST(test_what_waited_20_ms_or_is_left_at_the_end_is_sent);
    RUN_TEST(test_only_the_first_sample_after_boot_says_reset);
    RUN_TEST(test_encoders_use_all_their_32_bits);
    RUN_TEST(test_can_sends_time_and_epoch_first_and_every_hundredth_sample);
    RUN_TEST(test_what_the_carrier_refuses_is_counted_and_its_number_used_up);
    RUN_TEST(test_half_a_time_base_is_sent_again_whole);
    return UNITY_END();
}
