/* The bench test's part of this board: there is none yet. */
#ifndef BENCH_H
#define BENCH_H

#include "impid_settings.h"

#include <stddef.h>

#define BENCH_PORT NULL

static inline void bench_start(const impid_settings_t *settings) {
    (void)settings;
}

static inline void bench_poll(void) {
}

#endif
