#include "impid_stream.h"

#include "impid_assert.h"
#include "impid_sampler.h"

#include <string.h>

#define LOW28 0x0FFFFFFFu

void impid_stream_init(impid_stream_t *stream, uint16_t boot_id, uint32_t first_index, bool wide) {
    memset(stream, 0, sizeof *stream);
    stream->boot_id = boot_id;
    stream->wide = wide;
    stream->next_index = first_index;
    stream->reset_pending = true;
}

void impid_stream_begin(impid_stream_t *stream, uint32_t first_index) {
    stream->count = 0;
    stream->flags = 0;
    stream->began = false;
    stream->next_index = first_index;
}

void impid_stream_join(impid_stream_t *stream, impid_carrier_t carrier) {
    stream->on[carrier] = true;
    if (carrier == IMPID_CARRIER_CAN) {
        stream->can_samples_to_time = 0;
    }
}

static void flush(impid_stream_t *stream, impid_link_t *links, const impid_port_t *port) {
    if (stream->count == 0u) {
        return;
    }
    struct impid_messages_batch_t header = {
        .kind = (uint8_t)(stream->wide ? IMPID_MESSAGES_BATCH_KIND_SAMPLES_WIDE_CHOICE
                                       : IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE),
        .boot_id = stream->boot_id,
        .count = stream->count,
        .flags = stream->flags,
        .first_index = stream->first_index,
        .t0_us = stream->t0_us,
    };
    (void)impid_link_send_serial(&links[IMPID_CARRIER_SERIAL], port, header, stream->records);
    stream->count = 0;
    stream->flags = 0;
}

void impid_stream_leave(impid_stream_t *stream, impid_carrier_t carrier, impid_link_t *links,
                        const impid_port_t *port) {
    if (carrier == IMPID_CARRIER_SERIAL) {
        flush(stream, links, port);
    }
    stream->on[carrier] = false;
}

bool impid_stream_active(const impid_stream_t *stream) {
    return stream->on[IMPID_CARRIER_SERIAL] || stream->on[IMPID_CARRIER_CAN];
}

static size_t record_size(const impid_stream_t *stream) {
    return stream->wide ? IMPID_RECORD_SAMPLE_WIDE : IMPID_RECORD_SAMPLE;
}

static void pack_sample(const impid_sample_t *sample, uint8_t record[IMPID_RECORD_SAMPLE]) {
    struct impid_messages_accel_t accel = {
        .ax = sample->accel[0],
        .ay = sample->accel[1],
        .index_low16 = (uint16_t)sample->index,
        .flags = sample->flags,
        .enc1_high4 = (uint8_t)(sample->encoder[0] >> 28),
        .enc2_high4 = (uint8_t)(sample->encoder[1] >> 28),
    };
    struct impid_messages_encoder_t encoder = {
        .enc1_low28 = sample->encoder[0] & LOW28,
        .enc2_low28 = sample->encoder[1] & LOW28,
        .index_low8 = (uint8_t)sample->index,
    };
    (void)impid_messages_accel_pack(&record[0], &accel, 8u);
    (void)impid_messages_encoder_pack(&record[8], &encoder, 8u);
}

#if IMPID_AXES_MAX > 2u
static void pack_fine(const impid_sample_t *sample, uint8_t out[IMPID_MESSAGES_ACCEL_FINE_LENGTH]) {
    struct impid_messages_accel_fine_t fine = {
        .az_high16 = sample->accel[2],
        .ax_low8 = sample->fine[0],
        .ay_low8 = sample->fine[1],
        .az_low8 = sample->fine[2],
        .index_low16 = (uint16_t)sample->index,
    };
    (void)impid_messages_accel_fine_pack(out, &fine, IMPID_MESSAGES_ACCEL_FINE_LENGTH);
}
#endif

static void add_to_batch(impid_stream_t *stream, const impid_sample_t *sample, uint64_t t_us,
                         const uint8_t *record, impid_link_t *links, const impid_port_t *port) {
    bool follows = sample->index == stream->next_index && (!stream->began || t_us == stream->next_t_us);
    if (!follows) {
        flush(stream, links, port);
        stream->flags = IMPID_BATCH_FLAG_GAP;
    }
    if (stream->count == 0u) {
        stream->first_index = sample->index;
        stream->t0_us = t_us;
    }
    /* The receiver has no index and no time of the others in a batch. */
    IMPID_ASSERT(stream->count < IMPID_BATCH_SAMPLES);
    IMPID_ASSERT(sample->index == stream->first_index + stream->count);
    IMPID_ASSERT(t_us == stream->t0_us + (uint64_t)stream->count * IMPID_PERIOD_US);
    memcpy(&stream->records[stream->count * record_size(stream)], record, record_size(stream));
    stream->count++;
    if (stream->count == IMPID_BATCH_SAMPLES) {
        flush(stream, links, port);
    }
}

static bool send_time(const impid_stream_t *stream, const impid_sample_t *sample, uint64_t t_us,
                      impid_link_t *link, const impid_port_t *port) {
    uint8_t payload[8];
    struct impid_messages_time_t time = {.t_us = t_us, .index_low16 = (uint16_t)sample->index};
    struct impid_messages_epoch_t epoch = {
        .index = sample->index, .boot_id = stream->boot_id, .version = IMPID_PROTOCOL_VERSION};
    (void)impid_messages_time_pack(payload, &time, sizeof payload);
    bool sent = impid_link_send_can(link, port, IMPID_MESSAGES_TIME_FRAME_ID, payload);
    (void)impid_messages_epoch_pack(payload, &epoch, sizeof payload);
    return impid_link_send_can(link, port, IMPID_MESSAGES_EPOCH_FRAME_ID, payload) && sent;
}

static void send_on_can(impid_stream_t *stream, const impid_sample_t *sample, uint64_t t_us,
                        const uint8_t *record, impid_link_t *link, const impid_port_t *port) {
    /* A pair that was dropped is sent again with the next sample: without it the host has no time base. */
    if (stream->can_samples_to_time == 0u && send_time(stream, sample, t_us, link, port)) {
        stream->can_samples_to_time = IMPID_CAN_TIME_SAMPLES;
    }
    IMPID_ASSERT(stream->can_samples_to_time <= IMPID_CAN_TIME_SAMPLES);
    if (stream->can_samples_to_time > 0u) {
        stream->can_samples_to_time--;
    }
    if (stream->wide) {
        (void)impid_link_send_can(link, port, IMPID_MESSAGES_ACCEL_FINE_FRAME_ID,
                                  &record[IMPID_RECORD_SAMPLE]);
    }
    (void)impid_link_send_can(link, port, IMPID_MESSAGES_ACCEL_FRAME_ID, &record[0]);
    (void)impid_link_send_can(link, port, IMPID_MESSAGES_ENCODER_FRAME_ID, &record[8]);
}

void impid_stream_sample(impid_stream_t *stream, const impid_sample_t *sample, uint64_t t_us,
                         impid_link_t *links, const impid_port_t *port) {
    impid_sample_t flagged = *sample;
    if (stream->reset_pending) {
        flagged.flags |= IMPID_FLAG_RESET;
        stream->reset_pending = false;
    }
    uint8_t record[IMPID_RECORD_SAMPLE_MAX];
#if IMPID_AXES_MAX > 2u
    if (stream->wide) {
        flagged.flags |= IMPID_FLAG_FINE;
        pack_fine(&flagged, &record[IMPID_RECORD_SAMPLE]);
    }
#endif
    pack_sample(&flagged, record);
    if (stream->on[IMPID_CARRIER_SERIAL]) {
        add_to_batch(stream, sample, t_us, record, links, port);
    }
    if (stream->on[IMPID_CARRIER_CAN]) {
        send_on_can(stream, sample, t_us, record, &links[IMPID_CARRIER_CAN], port);
    }
    stream->began = true;
    stream->next_index = sample->index + 1u;
    stream->next_t_us = t_us + IMPID_PERIOD_US;
}

void impid_stream_flush_aged(impid_stream_t *stream, uint64_t now_us, impid_link_t *links,
                             const impid_port_t *port) {
    if (stream->count > 0u && now_us - stream->t0_us >= IMPID_BATCH_AGE_US) {
        flush(stream, links, port);
    }
}
