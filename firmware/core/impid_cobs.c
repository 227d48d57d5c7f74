#include "impid_cobs.h"

#include <stdbool.h>

/* The longest run of bytes that one code byte can announce. */
#define LONGEST_RUN 254u

size_t impid_cobs_encode(const uint8_t *bytes, size_t count, uint8_t *encoded) {
    /* By pointers: six instructions a byte on the chip, where indices take eleven. */
    const uint8_t *from = bytes;
    const uint8_t *const end = &bytes[count];
    uint8_t *to = encoded;
    bool more = true; /* a run follows: also the empty one that ends after a last zero */
    while (more) {
        uint8_t *const code = to++; /* of the run under way; gets its value once the length is known */
        const uint8_t *const limit = (size_t)(end - from) < LONGEST_RUN ? end : &from[LONGEST_RUN];
        uint8_t byte = UINT8_MAX;
        while (from < limit) {
            byte = *from++;
            if (byte == 0u) {
                break; /* the code byte stands for the zero as well */
            }
            *to++ = byte;
        }
        *code = (uint8_t)(to - code);
        more = byte == 0u || from < end; /* the longest run ends without a zero */
    }
    return (size_t)(to - encoded);
}

size_t impid_cobs_decode(uint8_t *bytes, size_t count) {
    size_t out = 0;
    uint32_t left = 0; /* of the run under way */
    bool zero = false; /* one stands between that run and the next */
    for (size_t in = 0; in < count; in++) {
        uint8_t byte = bytes[in];
        if (byte == 0u) {
            return 0;
        }
        if (left > 0u) {
            bytes[out++] = byte;
            left--;
        } else {
            if (zero) {
                bytes[out++] = 0u;
            }
            left = byte - 1u;
            zero = byte <= LONGEST_RUN;
        }
    }
    return left == 0u ? out : 0u;
}
