#include "impid_cobs.h"

size_t impid_cobs_encode(const uint8_t *bytes, size_t count, uint8_t *encoded) {
    size_t code_at = 0;
    size_t out = 1;
    uint8_t code = 1;
    for (size_t i = 0; i < count; i++) {
        if (bytes[i] != 0u) {
            encoded[out++] = bytes[i];
            code++;
        }
        /* A block of 254 bytes without zero closes by itself, unless the data end with it. */
        if (bytes[i] == 0u || (code == 0xFFu && i + 1u < count)) {
            encoded[code_at] = code;
            code_at = out++;
            code = 1;
        }
    }
    encoded[code_at] = code;
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
