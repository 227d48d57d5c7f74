#include "impid_output.h"

#include "impid_status.h"

uint64_t impid_output_now_us(impid_core_t *core) {
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
                .uptime_s = (uint32_t)((impid_output_now_us(core) - core->config.boot_us) / 1000000u)},
        .losses = {.line_errors = health.line_errors,
                   .can_overruns = health.can_overruns,
                   .adc_overruns = health.adc_overruns,
                   .dma_errors = health.dma_errors},
    };
}

void impid_output_record(impid_core_t *core, impid_carrier_t carrier, uint8_t kind, const uint8_t *record) {
    if (carrier == IMPID_CARRIER_SERIAL) {
        struct impid_messages_batch_t header = {
            .kind = kind,
            .boot_id = core->config.boot_id,
            .count = 1,
            .first_index = core->stream.next_index,
            .t0_us = impid_output_now_us(core),
        };
        (void)impid_link_send_serial(&core->links[carrier], core->port, header, record);
        return;
    }
    uint16_t id = kind == IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE ? IMPID_MESSAGES_PONG_FRAME_ID
                                                                : IMPID_MESSAGES_RESPONSE_FRAME_ID;
    (void)impid_link_send_can(&core->links[carrier], core->port, id, record);
}

void impid_output_status(impid_core_t *core, impid_carrier_t carrier) {
    impid_status_t status = gather_status(core, carrier);
    uint8_t record[IMPID_STATUS_LENGTH];
    impid_status_pack(&status, record);
    if (carrier == IMPID_CARRIER_SERIAL) {
        impid_output_record(core, carrier, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE, record);
        return;
    }
    for (uint32_t n = 0; n < IMPID_STATUS_MESSAGES; n++) {
        uint32_t at;
        uint16_t id = impid_status_message_id(n, &at);
        (void)impid_link_send_can(&core->links[carrier], core->port, id, &record[at]);
    }
}

void impid_output_status_everywhere(impid_core_t *core) {
    impid_output_status(core, IMPID_CARRIER_SERIAL);
    impid_output_status(core, IMPID_CARRIER_CAN);
}

static void finish_selftest(impid_core_t *core) {
    impid_sampler_stop(&core->sampler);
    impid_sampler_discard(&core->sampler);
    impid_output_status_everywhere(core);
}

void impid_output_drain(impid_core_t *core) {
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
