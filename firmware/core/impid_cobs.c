#include "impid_cobs.h"

#include <stdbool.h>

/* The longest run of bytes that one code byte can announce. */
#define LONGEST_RUN 254u

size_t impid_cobs_encode(const uint8_t *bytes, size_t count, uint8_t *encoded) {
    size_t in = 0;
    size_t out = 0;
    bool more = true;
    while (more) {
        /* 1. A run without zero goes over as it is: this inner loop is most of what a batch costs. */
        size_t longest = count - in < LONGEST_RUN ? count - in : LONGEST_RUN;
        size_t run = 0;
        while (run < longest && bytes[in + run] != 0u) {
            encoded[out + 1u + run] = bytes[in + run];
            run++;
        }
        /* 2. Its code byte stands before it. */
        encoded[out] = (uint8_t)(run + 1u);
        out += run + 1u;
        in += run;
        /* 3. A run that stopped short of the longest stands for the zero behind it as well. */
        more = in < count;
        if (more && run < LONGEST_RUN) {
            in++;
        }
    }
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
