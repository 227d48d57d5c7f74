#include "impid_frame.h"

#include "impid_assert.h"
#include "impid_crc32.h"

#include <string.h>

#define CRC_LENGTH 4u

size_t impid_frame_record_size(uint8_t kind) {
    switch (kind) {
    case IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE:
        return IMPID_RECORD_SAMPLE;
    case IMPID_MESSAGES_BATCH_KIND_SAMPLES_WIDE_CHOICE:
        return IMPID_RECORD_SAMPLE_WIDE;
    case IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE:
        return 8u * IMPID_MESSAGES_STATUS_SAMPLES_LENGTH;
    case IMPID_MESSAGES_BATCH_KIND_RESPONSE_CHOICE:
        return IMPID_MESSAGES_RESPONSE_LENGTH;
    case IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE:
        return IMPID_MESSAGES_PONG_LENGTH;
    case IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE:
        return IMPID_MESSAGES_COMMAND_LENGTH;
    default:
        return 0u;
    }
}

size_t impid_frame_encode(const struct impid_messages_batch_t *header, const uint8_t *records, uint8_t *out) {
    uint8_t raw[IMPID_FRAME_RAW_MAX];
    size_t size = header->count * impid_frame_record_size(header->kind);
    IMPID_ASSERT(size <= IMPID_FRAME_RECORDS_MAX);
    (void)impid_messages_batch_pack(raw, header, sizeof raw);
    memcpy(&raw[IMPID_MESSAGES_BATCH_LENGTH], records, size);
    size_t length = IMPID_MESSAGES_BATCH_LENGTH + size;
    uint32_t crc = impid_crc32(raw, length);
    for (uint32_t i = 0; i < CRC_LENGTH; i++) {
        raw[length++] = (uint8_t)(crc >> (8u * i));
    }
    size_t used = impid_cobs_encode(raw, length, out);
    out[used++] = 0u;
    return used;
}

void impid_frame_parser_init(impid_frame_parser_t *parser) {
    memset(parser, 0, sizeof *parser);
}

/* A checksum over data and its own checksum is right when the two agree, byte for byte. */
static bool checksum_holds(const uint8_t *raw, size_t length) {
    uint32_t crc = impid_crc32(raw, length - CRC_LENGTH);
    uint32_t sent = 0;
    for (size_t i = 0; i < CRC_LENGTH; i++) {
        sent |= (uint32_t)raw[length - CRC_LENGTH + i] << (8u * i);
    }
    return crc == sent;
}

static bool accept(impid_frame_parser_t *parser, size_t encoded, impid_frame_view_t *frame) {
    size_t length = encoded <= sizeof parser->buffer ? impid_cobs_decode(parser->buffer, encoded) : 0u;
    if (length < IMPID_MESSAGES_BATCH_LENGTH + CRC_LENGTH || !checksum_holds(parser->buffer, length)) {
        parser->damaged++;
        return false;
    }
    (void)impid_messages_batch_unpack(&frame->header, parser->buffer, length);
    frame->records = &parser->buffer[IMPID_MESSAGES_BATCH_LENGTH];
    size_t size = impid_frame_record_size(frame->header.kind);
    if (frame->header.version != IMPID_PROTOCOL_VERSION || size == 0u || frame->header.count == 0u ||
        frame->header.count * size != length - IMPID_MESSAGES_BATCH_LENGTH - CRC_LENGTH) {
        parser->foreign++;
        return false;
    }
    parser->frames++;
    return true;
}

bool impid_frame_parser_push(impid_frame_parser_t *parser, uint8_t byte, impid_frame_view_t *frame) {
    IMPID_ASSERT(parser->length <= sizeof parser->buffer + 1u);
    if (byte != 0u) {
        if (parser->length < sizeof parser->buffer) {
            parser->buffer[parser->length] = byte;
        }
        /* One past the buffer marks a frame that is too long, however long it goes on. */
        parser->length += parser->length <= sizeof parser->buffer;
        return false;
    }
    size_t encoded = parser->length;
    parser->length = 0;
    /* Two delimiters in a row are how a sender makes sure that a frame starts: nothing was lost. */
    return encoded > 0u && accept(parser, encoded, frame);
}
