/* What the fuzz targets share: how they fail, and how they read their input. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define FUZZ_CHECK(condition)                                                                                \
    do {                                                                                                     \
        if (!(condition)) {                                                                                  \
            (void)fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);             \
            abort();                                                                                         \
        }                                                                                                    \
    } while (0)

/* The core's own assertions: a find as well. */
_Noreturn void impid_assert_failed(const char *what);
_Noreturn void impid_assert_failed(const char *what) {
    (void)fprintf(stderr, "assertion of the core does not hold: %s\n", what);
    abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef struct {
    const uint8_t *data;
    size_t left;
} fuzz_input_t;

/* The next bytes as a little-endian number; zeros where the input has ended. */
static inline uint32_t fuzz_take(fuzz_input_t *input, size_t bytes) {
    uint32_t value = 0;
    for (size_t i = 0; i < bytes && input->left > 0u; i++) {
        value |= (uint32_t)*input->data++ << (8u * i);
        input->left--;
    }
    return value;
}

#endif
