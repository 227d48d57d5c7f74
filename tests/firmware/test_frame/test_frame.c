#include "impid_crc32.h"
#include "impid_frame.h"

#include <string.h>
#include <unity.h>

void setUp(void) {
}

void tearDown(void) {
}

static impid_frame_parser_t parser;
static impid_frame_view_t view;

/* The largest batch, with zeros, runs and high bits in it. */
static size_t real_frame(uint8_t *encoded) {
    uint8_t records[IMPID_FRAME_RECORDS_MAX];
    for (uint32_t i = 0; i < sizeof records; i++) {
        records[i] = (uint8_t)(i % 5u == 0u ? 0u : 37u * i);
    }
    struct impid_messages_batch_t header = {.kind = IMPID_MESSAGES_BATCH_KIND_SAMPLES_WIDE_CHOICE,
                                            .version = IMPID_PROTOCOL_VERSION,
                                            .boot_id = 0x1234,
                                            .frame_seq = 77,
                                            .count = IMPID_BATCH_SAMPLES,
                                            .first_index = 0xFFFFFFFE,
                                            .t0_us = 0x123456789ABCull};
    return impid_frame_encode(&header, records, encoded);
}

static uint32_t accepted(const uint8_t *bytes, size_t count) {
    uint32_t frames = 0;
    for (size_t i = 0; i < count; i++) {
        frames += impid_frame_parser_push(&parser, bytes[i], &view);
    }
    return frames;
}

static void test_a_frame_is_accepted_as_sent(void) {
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    size_t length = real_frame(encoded);
    /* One less than a frame without zeros, which needs a second code byte of COBS. */
    TEST_ASSERT_EQUAL_UINT(IMPID_FRAME_ENCODED_MAX - 1u, length);
    impid_frame_parser_init(&parser);
    TEST_ASSERT_EQUAL_UINT32(1, accepted(encoded, length));
    TEST_ASSERT_EQUAL_UINT32(0xFFFFFFFEu, view.header.first_index);
    TEST_ASSERT_EQUAL_UINT64(0x123456789ABCull, view.header.t0_us);
    TEST_ASSERT_EQUAL_UINT8(37u, view.records[1]);
}

/* Every bit of a real frame, its delimiter included, flipped alone. The frame is never accepted, the next
 * one always is, except where the delimiter itself was hit: then the two run together and both are lost. */
static void test_no_single_bit_flip_is_accepted(void) {
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    size_t length = real_frame(encoded);
    for (size_t bit = 0; bit < 8u * length; bit++) {
        uint8_t damaged[IMPID_FRAME_ENCODED_MAX];
        memcpy(damaged, encoded, length);
        damaged[bit / 8u] ^= (uint8_t)(1u << bit % 8u);
        impid_frame_parser_init(&parser);
        TEST_ASSERT_EQUAL_UINT32(0, accepted(damaged, length));
        bool delimiter = bit / 8u == length - 1u;
        TEST_ASSERT_EQUAL_UINT32(delimiter ? 0 : 1, accepted(encoded, length));
        TEST_ASSERT_GREATER_OR_EQUAL_UINT32(1, parser.damaged);
        TEST_ASSERT_EQUAL_UINT32(0, parser.foreign);
        TEST_ASSERT_EQUAL_UINT32(1, accepted(encoded, length));
    }
}

static void test_resynchronises_at_every_place_of_entry_and_counts(void) {
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    size_t length = real_frame(encoded);
    for (size_t start = 1; start < length; start++) {
        impid_frame_parser_init(&parser);
        TEST_ASSERT_EQUAL_UINT32(0, accepted(&encoded[start], length - start));
        TEST_ASSERT_EQUAL_UINT32(start < length - 1u, parser.damaged);
        TEST_ASSERT_EQUAL_UINT32(1, accepted(encoded, length));
    }
}

static void test_a_frame_too_long_is_one_damaged_frame(void) {
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    size_t length = real_frame(encoded);
    impid_frame_parser_init(&parser);
    for (uint32_t i = 0; i < 100000u; i++) {
        TEST_ASSERT_FALSE(impid_frame_parser_push(&parser, 0x55u, &view));
    }
    TEST_ASSERT_FALSE(impid_frame_parser_push(&parser, 0u, &view));
    TEST_ASSERT_EQUAL_UINT32(1, parser.damaged);
    TEST_ASSERT_EQUAL_UINT32(1, accepted(encoded, length));
}

static void test_delimiters_alone_are_no_damage(void) {
    uint8_t zeros[10] = {0};
    impid_frame_parser_init(&parser);
    TEST_ASSERT_EQUAL_UINT32(0, accepted(zeros, sizeof zeros));
    TEST_ASSERT_EQUAL_UINT32(0, parser.damaged + parser.foreign);
}

static void test_valid_frames_that_mean_nothing_here_are_foreign(void) {
    const struct impid_messages_batch_t headers[] = {
        {.kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE,
         .version = IMPID_PROTOCOL_VERSION + 1u,
         .count = 1},
        {.kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 0},
        {.kind = 200, .version = IMPID_PROTOCOL_VERSION, .count = 0},
    };
    impid_frame_parser_init(&parser);
    for (uint32_t i = 0; i < 3u; i++) {
        uint8_t records[8] = {0};
        uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
        TEST_ASSERT_EQUAL_UINT32(0, accepted(encoded, impid_frame_encode(&headers[i], records, encoded)));
        TEST_ASSERT_EQUAL_UINT32(i + 1u, parser.foreign);
    }
    TEST_ASSERT_EQUAL_UINT32(0, parser.damaged);
}

/* Whole by its checksum, but not as long as its header says: a sender's mistake, never read beyond. */
static void test_a_count_that_does_not_fit_the_length_is_foreign(void) {
    const uint8_t counts[] = {2, 4, 255};
    impid_frame_parser_init(&parser);
    for (uint32_t i = 0; i < sizeof counts; i++) {
        struct impid_messages_batch_t header = {.kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE,
                                                .version = IMPID_PROTOCOL_VERSION,
                                                .count = counts[i]};
        uint8_t raw[IMPID_MESSAGES_BATCH_LENGTH + 3u * 8u + 4u] = {0};
        size_t length = sizeof raw - 4u;
        (void)impid_messages_batch_pack(raw, &header, length);
        uint32_t crc = impid_crc32(raw, length);
        for (uint32_t j = 0; j < 4u; j++) {
            raw[length + j] = (uint8_t)(crc >> (8u * j));
        }
        uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
        size_t used = impid_cobs_encode(raw, sizeof raw, encoded);
        encoded[used++] = 0u;
        TEST_ASSERT_EQUAL_UINT32(0, accepted(encoded, used));
        TEST_ASSERT_EQUAL_UINT32(i + 1u, parser.foreign);
    }
    TEST_ASSERT_EQUAL_UINT32(0, parser.damaged);
}

static void test_record_sizes_are_those_of_the_message_set(void) {
    TEST_ASSERT_EQUAL_UINT(16, impid_frame_record_size(IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
    TEST_ASSERT_EQUAL_UINT(24, impid_frame_record_size(IMPID_MESSAGES_BATCH_KIND_SAMPLES_WIDE_CHOICE));
    TEST_ASSERT_EQUAL_UINT(64, impid_frame_record_size(IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE));
    TEST_ASSERT_EQUAL_UINT(8, impid_frame_record_size(IMPID_MESSAGES_BATCH_KIND_RESPONSE_CHOICE));
    TEST_ASSERT_EQUAL_UINT(8, impid_frame_record_size(IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE));
    TEST_ASSERT_EQUAL_UINT(8, impid_frame_record_size(IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE));
    TEST_ASSERT_EQUAL_UINT(0, impid_frame_record_size(0));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_frame_is_accepted_as_sent);
    RUN_TEST(test_no_single_bit_flip_is_accepted);
    RUN_TEST(test_resynchronises_at_every_place_of_entry_and_counts);
    RUN_TEST(test_a_frame_too_long_is_one_damaged_frame);
    RUN_TEST(test_delimiters_alone_are_no_damage);
    RUN_TEST(test_valid_frames_that_mean_nothing_here_are_foreign);
    RUN_TEST(test_a_count_that_does_not_fit_the_length_is_foreign);
    RUN_TEST(test_record_sizes_are_those_of_the_message_set);
    return UNITY_END();
}
