/* The bench test's part of the board: levels, edges and frames that it makes for itself, and the ways to end
 * badly that it must survive. */
#ifndef BENCH_H
#define BENCH_H

#include "impid_bench.h"
#include "impid_settings.h"

/* `settings`: those to which the inputs return. */
void bench_start(const impid_settings_t *settings);
extern const impid_bench_port_t bench_port;
#define BENCH_PORT (&bench_port)
/* Main loop: hangs if it was told to, once the answer has left. */
void bench_poll(void);

#endif
