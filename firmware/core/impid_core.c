#include "impid_core.h"

#include "impid_command.h"
#include "impid_output.h"

#include <string.h>

void impid_core_init(impid_core_t *core, const impid_core_config_t *config, const impid_port_t *port) {
    memset(core, 0, sizeof *core);
    core->config = *config;
    core->port = port;
    if (core->config.sensor == NULL) {
        core->config.sensor = &impid_adxl203;
    }
    core->status_at_us = config->boot_us + IMPID_STATUS_PERIOD_US;
    impid_sampler_init(&core->sampler, core->config.sensor);
    impid_timebase_init(&core->timebase, config->boot_us);
    impid_stream_init(&core->stream, config->boot_id, config->first_index, core->config.sensor->wide);
    impid_selftest_init(&core->selftest, core->config.sensor);
    impid_frame_parser_init(&core->parser);
    impid_update_init(&core->update, config->slots);
    impid_bench_init(&core->bench, config->bench);
    if (core->config.trace != NULL) {
        impid_trace_begin(core->config.trace, config->boot_id);
    }
}

static void mark(impid_core_t *core) {
    if (core->config.trace != NULL) {
        impid_trace_mark(core->config.trace,
                         atomic_load_explicit(&core->sampler.produced, memory_order_relaxed));
    }
}

void impid_core_tick(impid_core_t *core, const impid_tick_t *tick) {
    impid_sampler_tick(&core->sampler, tick);
    mark(core);
    if (impid_histogram_left(&core->bench.histogram) > 0u) {
        for (uint32_t i = 0; i < IMPID_OVERSAMPLING; i++) {
            impid_histogram_add(&core->bench.histogram, IMPID_HISTOGRAM_X, tick->adc[2u * i]);
            impid_histogram_add(&core->bench.histogram, IMPID_HISTOGRAM_Y, tick->adc[2u * i + 1u]);
        }
    }
}

bool impid_core_wants_reference(const impid_core_t *core) {
    return impid_histogram_wants(&core->bench.histogram, IMPID_HISTOGRAM_REFERENCE);
}

void impid_core_reference(impid_core_t *core, uint16_t code) {
    impid_histogram_add(&core->bench.histogram, IMPID_HISTOGRAM_REFERENCE, code);
}

void impid_core_missed(impid_core_t *core, uint32_t ticks) {
    impid_sampler_missed(&core->sampler, ticks);
    mark(core);
}

void impid_core_poll(impid_core_t *core) {
    uint64_t now = impid_output_now_us(core);
    impid_output_drain(core);
    impid_stream_flush_aged(&core->stream, now, core->links, core->port);
    if (now >= core->status_at_us) {
        impid_output_status_everywhere(core);
        /* After a stall the missed ones are left out: ten a second, not a burst. */
        uint64_t periods = (now - core->status_at_us) / IMPID_STATUS_PERIOD_US + 1u;
        core->status_at_us += periods * IMPID_STATUS_PERIOD_US;
    }
}

void impid_core_serial_receive(impid_core_t *core, const uint8_t *bytes, size_t count, uint32_t t_us) {
    for (size_t i = 0; i < count; i++) {
        impid_frame_view_t frame;
        if (!impid_frame_parser_push(&core->parser, bytes[i], &frame)) {
            continue;
        }
        if (frame.header.kind != IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE) {
            core->rejected++;
            continue;
        }
        for (uint32_t n = 0; n < frame.header.count; n++) {
            struct impid_messages_command_t command;
            (void)impid_messages_command_unpack(&command, &frame.records[8u * n], 8u);
            impid_command_execute(core, IMPID_CARRIER_SERIAL, &command, t_us);
        }
    }
}

void impid_core_can_receive(impid_core_t *core, const impid_can_frame_t *frame, uint32_t t_us) {
    if (frame->id != IMPID_MESSAGES_COMMAND_FRAME_ID) {
        return; /* the bus is shared: other traffic is not ours to judge */
    }
    if (frame->dlc != IMPID_MESSAGES_COMMAND_LENGTH) {
        core->rejected++;
        return;
    }
    struct impid_messages_command_t command;
    (void)impid_messages_command_unpack(&command, frame->data, sizeof frame->data);
    impid_command_execute(core, IMPID_CARRIER_CAN, &command, t_us);
}
