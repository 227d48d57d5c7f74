#include "impid_cobs.h"
#include "impid_crc32.h"

#include <string.h>
#include <unity.h>

void setUp(void) {
}

void tearDown(void) {
}

static void test_crc_published_values(void) {
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926u, impid_crc32((const uint8_t *)"123456789", 9));
    TEST_ASSERT_EQUAL_HEX32(0x00000000u, impid_crc32((const uint8_t *)"", 0));
    TEST_ASSERT_EQUAL_HEX32(0x414FA339u,
                            impid_crc32((const uint8_t *)"The quick brown fox jumps over the lazy dog", 43));
    uint8_t bytes[32];
    /* RFC 3720's four patterns, with this polynomial as zlib gives them. */
    memset(bytes, 0, sizeof bytes);
    TEST_ASSERT_EQUAL_HEX32(0x190A55ADu, impid_crc32(bytes, sizeof bytes));
    memset(bytes, 0xFF, sizeof bytes);
    TEST_ASSERT_EQUAL_HEX32(0xFF6CAB0Bu, impid_crc32(bytes, sizeof bytes));
}

/* Every entry of the table against the division that it stands for. */
static void test_crc_of_every_byte(void) {
    for (uint32_t n = 0; n < 256u; n++) {
        uint32_t crc = UINT32_MAX ^ n;
        for (uint32_t bit = 0; bit < 8u; bit++) {
            crc = (crc >> 1) ^ ((crc & 1u) != 0u ? 0xEDB88320u : 0u);
        }
        uint8_t byte = (uint8_t)n;
        TEST_ASSERT_EQUAL_HEX32(~crc, impid_crc32(&byte, 1));
    }
}

static void check_cobs(const uint8_t *plain, size_t count, const uint8_t *coded, size_t coded_count) {
    uint8_t encoded[300];
    TEST_ASSERT_EQUAL_UINT(coded_count, impid_cobs_encode(plain, count, encoded));
    TEST_ASSERT_EQUAL_UINT8_ARRAY(coded, encoded, coded_count);
    TEST_ASSERT_EQUAL_UINT(count, impid_cobs_decode(encoded, coded_count));
    if (count > 0u) {
        TEST_ASSERT_EQUAL_UINT8_ARRAY(plain, encoded, count);
    }
}

/* The examples by which the coding is usually explained, and the block boundary at 254 on both sides. */
static void test_cobs_published_examples(void) {
    check_cobs((const uint8_t[]){0}, 1, (const uint8_t[]){1, 1}, 2);
    check_cobs((const uint8_t[]){0, 0}, 2, (const uint8_t[]){1, 1, 1}, 3);
    check_cobs((const uint8_t[]){0, 0x11, 0}, 3, (const uint8_t[]){1, 2, 0x11, 1}, 4);
    check_cobs((const uint8_t[]){0x11, 0x22, 0, 0x33}, 4, (const uint8_t[]){3, 0x11, 0x22, 2, 0x33}, 5);
    check_cobs((const uint8_t[]){0x11, 0x22, 0x33, 0x44}, 4, (const uint8_t[]){5, 0x11, 0x22, 0x33, 0x44}, 5);
    check_cobs((const uint8_t[]){0x11, 0, 0, 0}, 4, (const uint8_t[]){2, 0x11, 1, 1, 1}, 5);
    check_cobs((const uint8_t[]){0}, 0, (const uint8_t[]){1}, 1);
}

static void test_cobs_block_boundaries(void) {
    uint8_t plain[256];
    uint8_t coded[260];
    for (uint32_t i = 0; i < 256u; i++) {
        plain[i] = (uint8_t)i; /* 00 01 .. FF */
    }
    memcpy(&coded[1], &plain[1], 254); /* 01..FE */
    coded[0] = 0xFF;
    check_cobs(&plain[1], 254, coded, 255);

    memcpy(&coded[2], &plain[1], 254); /* 00 01..FE */
    coded[0] = 1;
    coded[1] = 0xFF;
    check_cobs(plain, 255, coded, 256);

    coded[0] = 0xFF; /* 01..FF */
    memcpy(&coded[1], &plain[1], 254);
    coded[255] = 2;
    coded[256] = 0xFF;
    check_cobs(&plain[1], 255, coded, 257);

    uint8_t ends_with_zero[255]; /* 02..FF 00 */
    memcpy(ends_with_zero, &plain[2], 254);
    ends_with_zero[254] = 0;
    memcpy(&coded[1], &plain[2], 254);
    coded[255] = 1;
    coded[256] = 1;
    check_cobs(ends_with_zero, 255, coded, 257);
}

static void test_cobs_refuses_what_is_no_code(void) {
    uint8_t inside[] = {3, 0x11, 0};
    TEST_ASSERT_EQUAL_UINT(0, impid_cobs_decode(inside, sizeof inside));
    uint8_t too_short[] = {5, 0x11, 0x22};
    TEST_ASSERT_EQUAL_UINT(0, impid_cobs_decode(too_short, sizeof too_short));
    uint8_t zero_code[] = {0};
    TEST_ASSERT_EQUAL_UINT(0, impid_cobs_decode(zero_code, sizeof zero_code));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_crc_published_values);
    RUN_TEST(test_crc_of_every_byte);
    RUN_TEST(test_cobs_published_examples);
    RUN_TEST(test_cobs_block_boundaries);
    RUN_TEST(test_cobs_refuses_what_is_no_code);
    return UNITY_END();
}
