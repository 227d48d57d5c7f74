/* Everything that the core remembers, in one struct: what its parts are and who may touch them.
 *
 * Data flow: none of its own; impid_output, impid_command and impid_core, in this order, work on it.
 * Ownership: the caller of impid_core_init. Timing: the sampler is shared with the interrupt under its own
 * contract, all else belongs to the main loop. Can fail: no.
 */
#ifndef IMPID_STATE_H
#define IMPID_STATE_H

#include "impid_bench.h"
#include "impid_frame.h"
#include "impid_link.h"
#include "impid_port.h"
#include "impid_replies.h"
#include "impid_sampler.h"
#include "impid_selftest.h"
#include "impid_settings.h"
#include "impid_stream.h"
#include "impid_timebase.h"
#include "impid_trace.h"
#include "impid_update.h"

#define IMPID_FIRMWARE_VERSION 0x000200u /* major << 16 | minor << 8 | patch */

typedef struct {
    const impid_sensor_t *sensor; /* NULL: impid_adxl203 */
    uint32_t uid[3];
    uint32_t board_id;     /* CRC-32 of the board's name: an image is for one kind of board */
    uint32_t build_commit; /* impid_build.h */
    uint32_t build_state;
    uint16_t boot_id;           /* differs from that of the boot before */
    uint8_t reset_cause;        /* as STATUS_HEALTH.reset_cause */
    uint8_t clock_source;       /* as STATUS_HEALTH.clock_source */
    uint32_t external_clock_hz; /* as the internal oscillator counts it; 0: not measured */
    uint32_t first_index;       /* index of the first sample after START */
    uint64_t boot_us;           /* the board's time at init; its low half is the port's counter */
    impid_settings_t *settings; /* NULL: this board keeps none, and knows no GET, SET, SAVE */
    const uint32_t *log;        /* the last fault record, NULL: none is kept, and LOG is not known */
    uint8_t log_words;
    const impid_update_port_t *slots; /* where an update goes; NULL: this board knows none */
    const impid_bench_port_t *bench;  /* NULL: this board has no bench test */
    impid_trace_t *trace;             /* in memory that outlives a reset; NULL: this board has none */
} impid_core_config_t;

typedef struct {
    impid_sampler_t sampler; /* shared with the interrupt, under the sampler's contract */
    /* All below belongs to the main loop. */
    impid_core_config_t config;
    const impid_port_t *port;
    impid_timebase_t timebase;
    impid_stream_t stream;
    impid_selftest_t selftest;
    impid_frame_parser_t parser;
    impid_replies_t replies;
    impid_update_t update;
    impid_bench_t bench; /* its histogram is shared with the interrupt, under its contract */
    impid_link_t links[IMPID_CARRIERS];
    uint32_t accepted;     /* commands carried out */
    uint32_t rejected;     /* frames and commands that made no sense, apart from the parser's */
    uint64_t status_at_us; /* when the next periodic STATUS is due */
} impid_core_t;

#endif
