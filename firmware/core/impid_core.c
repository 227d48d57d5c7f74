#include "impid_core.h"

#include "impid_command.h"
#include "impid_status.h"

#include <string.h>

void impid_core_init(impid_core_t *core, const impid_core_config_t *config, const impid_port_t *port) {
    memset(core, 0, sizeof *core);
    core->config = *config;
    core->port = port;
    core->status_at_us = config->boot_us + IMPID_STATUS_PERIOD_US;
    impid_sampler_init(&core->sampler);
    impid_timebase_init(&core->timebase, config->boot_us);
    impid_stream_init(&core->stream, config->boot_id, config->first_index);
    impid_selftest_init(&core->selftest, config->vref_mV);
    impid_frame_parser_init(&core->parser);
}

void impid_core_tick(impid_core_t *core, const impid_tick_t *tick) {
    impid_sampler_tick(&core->sampler, tick);
}

void impid_core_missed(impid_core_t *core, uint32_t ticks) {
    impid_sampler_missed(&core->sampler, ticks);
}

static uint64_t now_us(impid_core_t *core) {
    return impid_timebase_extend(&core->timebase, core->port->now_us(core->port->context));
}

static uint8_t state(const impid_core_t *core) {
    if (impid_selftest_running(&core->selftest)) {
        return IMPID_MESSAGES_STATUS_HEALTH_STATE_SELF_TESTING_CHOICE;
    }
    return impid_stream_active(&core->stream) ? IMPID_MESSAGES_STATUS_HEALTH_STATE_STREAMING_CHOICE
                                              : IMPID_MESSAGES_STATUS_HEALTH_STATE_IDLE_CHOICE;
}

static impid_status_t gather_status(impid_core_t *core, impid_carrier_t carrier) {
    impid_port_health_t health = core->port->health(core->port->context);
    const impid_sampler_t *sampler = &core->sampler;
    const impid_link_t *link = &core->links[carrier];
    return (impid_status_t){
        .samples = {.produced = sampler->produced, .ring_lost = impid_ring_lost(&sampler->ring)},
        .link = {.frames_sent = link->frames_sent, .frames_dropped = link->frames_dropped},
        .timing = {.late = sampler->late, .overruns = sampler->overruns},
        .sensors = {.saturated = sampler->saturated, .encoder_faults = sampler->encoder_faults},
        .commands = {.accepted = core->accepted,
                     .rejected =
                         core->rejected + core->parser.damaged + core->parser.foreign + health.rejected},
        .health = {.state = state(core),
                   .reset_cause = core->config.reset_cause,
                   .clock_source = core->config.clock_source,
                   .self_test = core->selftest.verdict,
                   .supply_m_v = health.supply_mV,
                   .worst_tick_us = health.worst_tick_us},
        .bus = {.bus_off = health.bus_off,
                .tx_errors = health.tx_errors,
                .rx_errors = health.rx_errors,
                .uptime_s = (uint32_t)((now_us(core) - core->config.boot_us) / 1000000u)},
    };
}

void impid_core_send_record(impid_core_t *core, impid_carrier_t carrier, uint8_t kind,
                            const uint8_t *record) {
    if (carrier == IMPID_CARRIER_SERIAL) {
        struct impid_messages_batch_t header = {
            .kind = kind,
            .boot_id = core->config.boot_id,
            .count = 1,
            .first_index = core->stream.next_index,
            .t0_us = now_us(core),
        };
        (void)impid_link_send_serial(&core->links[carrier], core->port, header, record);
        return;
    }
    uint16_t id = kind == IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE ? IMPID_MESSAGES_PONG_FRAME_ID
                                                                : IMPID_MESSAGES_RESPONSE_FRAME_ID;
    (void)impid_link_send_can(&core->links[carrier], core->port, id, record);
}

void impid_core_send_status(impid_core_t *core, impid_carrier_t carrier) {
    impid_status_t status = gather_status(core, carrier);
    uint8_t record[IMPID_STATUS_LENGTH];
    impid_status_pack(&status, record);
    if (carrier == IMPID_CARRIER_SERIAL) {
        impid_core_send_record(core, carrier, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE, record);
        return;
    }
    for (uint32_t n = 0; n < IMPID_STATUS_MESSAGES; n++) {
        (void)impid_link_send_can(&core->links[carrier], core->port, impid_status_message_id(n),
                                  &record[8u * n]);
    }
}

static void send_status_everywhere(impid_core_t *core) {
    impid_core_send_status(core, IMPID_CARRIER_SERIAL);
    impid_core_send_status(core, IMPID_CARRIER_CAN);
}

static void finish_selftest(impid_core_t *core) {
    impid_sampler_stop(&core->sampler);
    impid_sampler_discard(&core->sampler);
    send_status_everywhere(core);
}

void impid_core_drain(impid_core_t *core) {
    impid_sample_t sample;
    /* The interrupt may add samples meanwhile; they wait for the next call, so this one ends. */
    for (uint32_t i = 0; i < IMPID_RING_SAMPLES && impid_ring_pop(&core->sampler.ring, &sample); i++) {
        if (impid_selftest_running(&core->selftest)) {
            if (impid_selftest_sample(&core->selftest, &sample, core->port)) {
                finish_selftest(core);
            }
        } else {
            uint64_t t_us = impid_timebase_extend(&core->timebase, sample.t_us);
            impid_stream_sample(&core->stream, &sample, t_us, core->links, core->port);
        }
    }
}

void impid_core_poll(impid_core_t *core) {
    uint64_t now = now_us(core);
    impid_core_drain(core);
    impid_stream_flush_aged(&core->stream, now, core->links, core->port);
    if (now >= core->status_at_us) {
        send_status_everywhere(core);
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
