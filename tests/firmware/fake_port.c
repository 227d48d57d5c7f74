#include "fake_port.h"

#include <string.h>
#include <unity.h>

static uint32_t now_us(void *context) {
    return ((fake_port_t *)context)->now_us;
}

static bool serial_send(void *context, const uint8_t *bytes, size_t count) {
    fake_port_t *fake = context;
    if (fake->refuse) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        impid_frame_view_t frame;
        if (impid_frame_parser_push(&fake->parser, bytes[i], &frame)) {
            TEST_ASSERT_LESS_THAN_UINT32(FAKE_FRAMES, fake->frames);
            fake->headers[fake->frames] = frame.header;
            memcpy(fake->records[fake->frames], frame.records,
                   frame.header.count * impid_frame_record_size(frame.header.kind));
            fake->frames++;
        }
    }
    return true;
}

static bool can_send(void *context, const impid_can_frame_t *frame) {
    fake_port_t *fake = context;
    if (fake->refuse) {
        return false;
    }
    if (fake->can_room_after > 0u) {
        fake->can_room_after--;
        return false;
    }
    TEST_ASSERT_LESS_THAN_UINT32(FAKE_FRAMES, fake->can_frames);
    fake->can[fake->can_frames++] = *frame;
    return true;
}

static uint32_t backlog_us(void *context, impid_carrier_t carrier) {
    (void)carrier;
    return ((fake_port_t *)context)->backlog_us;
}

static void self_test_pin(void *context, bool drive) {
    ((fake_port_t *)context)->pin = drive;
}

static impid_port_health_t health(void *context) {
    return (impid_port_health_t){.bus_off = 3,
                                 .tx_errors = 17,
                                 .rx_errors = 19,
                                 .supply_mV = ((fake_port_t *)context)->supply_mV,
                                 .worst_tick_us = 42,
                                 .sync_us = 7654321,
                                 .sync_count = 3,
                                 .rejected = ((fake_port_t *)context)->rejected,
                                 .line_errors = 21,
                                 .can_overruns = 22,
                                 .adc_overruns = 23,
                                 .dma_errors = 24};
}

static void request_reset(void *context) {
    ((fake_port_t *)context)->reset_requested = true;
}

void fake_port_init(fake_port_t *fake) {
    memset(fake, 0, sizeof *fake);
    fake->supply_mV = 3300;
    impid_frame_parser_init(&fake->parser);
    fake->port =
        (impid_port_t){fake, now_us, serial_send, can_send, backlog_us, self_test_pin, health, request_reset};
}

const uint8_t *fake_last_record(const fake_port_t *fake, uint8_t kind) {
    for (uint32_t i = fake->frames; i > 0u; i--) {
        if (fake->headers[i - 1u].kind == kind) {
            return fake->records[i - 1u];
        }
    }
    TEST_FAIL_MESSAGE("the board sent no frame of this kind");
    return NULL;
}

uint32_t fake_count(const fake_port_t *fake, uint8_t kind) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < fake->frames; i++) {
        count += fake->headers[i].kind == kind;
    }
    return count;
}

void fake_send_command(impid_core_t *core, impid_carrier_t carrier, uint16_t request_id, uint8_t opcode,
                       uint8_t item, uint32_t value, uint32_t t_us) {
    struct impid_messages_command_t command = {request_id, opcode, item, value};
    impid_can_frame_t frame = {.id = IMPID_MESSAGES_COMMAND_FRAME_ID, .dlc = 8};
    (void)impid_messages_command_pack(frame.data, &command, sizeof frame.data);
    if (carrier == IMPID_CARRIER_CAN) {
        impid_core_can_receive(core, &frame, t_us);
        return;
    }
    struct impid_messages_batch_t header = {
        .kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 1};
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    impid_core_serial_receive(core, encoded, impid_frame_encode(&header, frame.data, encoded), t_us);
}

struct impid_messages_response_t fake_response(const fake_port_t *fake) {
    struct impid_messages_response_t response;
    (void)impid_messages_response_unpack(
        &response, fake_last_record(fake, IMPID_MESSAGES_BATCH_KIND_RESPONSE_CHOICE), 8);
    return response;
}

void fake_period(impid_core_t *core, fake_port_t *fake, uint16_t x, uint16_t y, uint8_t flags) {
    uint16_t adc[2u * IMPID_OVERSAMPLING];
    for (uint32_t i = 0; i < IMPID_OVERSAMPLING; i++) {
        adc[2u * i] = x;
        adc[2u * i + 1u] = y;
    }
    fake->now_us += IMPID_PERIOD_US;
    impid_tick_t tick = {.adc = adc, .t_us = fake->now_us, .flags = flags};
    impid_core_tick(core, &tick);
    impid_core_poll(core);
}
