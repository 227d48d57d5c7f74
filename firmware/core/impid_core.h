/* The sensor board without its hardware: everything that is the same on every board.
 *
 * Data flow: impid_core_tick() brings the conversions and counters of one period in; samples wait in a
 * ring; impid_core_poll() brings them out, as frames through the port, to the carriers that asked. Commands
 * come in by the receive functions and are answered before these return.
 * Ownership: the caller owns the context and keeps it at one address; nothing is allocated, nothing is
 * global, so that one process can hold many boards.
 * Timing: tick() and missed() belong to the sampling interrupt (worst case: 56 multiply-adds and one ring
 * slot), everything else to one main loop, which the interrupt may preempt anywhere and never the reverse.
 * poll() is bounded by the ring: at most 256 samples a call. It should run at least every 100 ms.
 * Can fail: nothing returns an error. What goes wrong is counted, and the counters are in STATUS.
 */
#ifndef IMPID_CORE_H
#define IMPID_CORE_H

#include "impid_frame.h"
#include "impid_link.h"
#include "impid_port.h"
#include "impid_replies.h"
#include "impid_sampler.h"
#include "impid_selftest.h"
#include "impid_settings.h"
#include "impid_stream.h"
#include "impid_timebase.h"

#define IMPID_FIRMWARE_VERSION 0x000100u /* major << 16 | minor << 8 | patch */
#define IMPID_STATUS_PERIOD_US 100000u

typedef struct {
    uint32_t uid[3];
    uint16_t boot_id;           /* differs from that of the boot before */
    uint8_t reset_cause;        /* as STATUS_HEALTH.reset_cause */
    uint8_t clock_source;       /* as STATUS_HEALTH.clock_source */
    uint16_t vref_mV;           /* converter reference, which is the accelerometer's supply */
    uint32_t first_index;       /* index of the first sample after START */
    uint64_t boot_us;           /* the board's time at init; its low half is the port's counter */
    impid_settings_t *settings; /* NULL: this board keeps none, and knows no GET, SET, SAVE */
    const uint32_t *log;        /* the last fault record, NULL: none is kept, and LOG is not known */
    uint8_t log_words;
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
    impid_link_t links[IMPID_CARRIERS];
    uint32_t accepted;     /* commands carried out */
    uint32_t rejected;     /* frames and commands that made no sense, apart from the parser's */
    uint64_t status_at_us; /* when the next periodic STATUS is due */
} impid_core_t;

void impid_core_init(impid_core_t *core, const impid_core_config_t *config, const impid_port_t *port);

/* Sampling interrupt. */
void impid_core_tick(impid_core_t *core, const impid_tick_t *tick);
void impid_core_missed(impid_core_t *core, uint32_t ticks);

/* Main loop. */
void impid_core_poll(impid_core_t *core);
/* t_us: the counter when the last of the bytes arrived. */
void impid_core_serial_receive(impid_core_t *core, const uint8_t *bytes, size_t count, uint32_t t_us);
void impid_core_can_receive(impid_core_t *core, const impid_can_frame_t *frame, uint32_t t_us);

/* For the core's own parts (main loop). */
void impid_core_drain(impid_core_t *core);
void impid_core_send_status(impid_core_t *core, impid_carrier_t carrier);
void impid_core_send_record(impid_core_t *core, impid_carrier_t carrier, uint8_t kind, const uint8_t *record);

#endif
