#include "impid_cobs.h"

#include <stdbool.h>

/* The longest run of bytes that one code byte can announce. */
#define LONGEST_RUN 254u

size_t impid_cobs_encode(const uint8_t *bytes, size_t count, uint8_t *encoded) {
    size_t code = 0; /* place of the code byte that the run under way gets once its length is known */
    size_t out = 1;
    for (size_t in = 0; in < count; in++) {
        bool ends = bytes[in] == 0u; /* the code byte stands for the zero as well */
        if (!ends) {
            encoded[out++] = bytes[in];
            /* The longest run ends without a zero; at the end of all no other follows it. */
            ends = out - code > LONGEST_RUN && in + 1u < count;
        }
        if (ends) {
            encoded[code] = (uint8_t)(out - code);
            code = out++;
        }
    }
    encoded[code] = (uint8_t)(out - code);
    return out;
}

size_t impid_cobs_decode(uint8_t *bytes, size_t count) {
    size_t in = 0;
    size_t out = 0;
    while (in < count) {
        uint8_t code = bytes[in++];
        if (code == 0u || (size_t)(code - 1u) > count - in) {
            return 0;
        }
        for (uint8_t i = 1; i < code; i++) {
            if (bytes[in] == 0u) {
                return 0;
            }
            bytes[out++] = bytes[in++];
        }
        if (code != 0xFFu && in < count) {
            bytes[out++] = 0u;
        }
    }
    return out;
}
