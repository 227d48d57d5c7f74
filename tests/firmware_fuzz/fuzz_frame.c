/* The frame parser, fed with arbitrary bytes.
 *
 * The first byte of the input says how: as they are, or as the content of one frame that is closed with a
 * right checksum and coded, which no fuzzer would find by itself. Must hold for every input: each piece
 * between delimiters is counted once, as a frame, as damaged or as foreign; a frame shown is as long as its
 * header says, and survives being sent again; after a delimiter the next frame is read.
 */
#include "fuzz.h"

#include "impid_crc32.h"
#include "impid_frame.h"

#include <string.h>

static void check_sent_again(const impid_frame_view_t *frame) {
    size_t size = frame->header.count * impid_frame_record_size(frame->header.kind);
    FUZZ_CHECK(size > 0u && size <= IMPID_FRAME_RECORDS_MAX);
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    size_t length = impid_frame_encode(&frame->header, frame->records, encoded);
    impid_frame_parser_t parser;
    impid_frame_view_t again = {0};
    impid_frame_parser_init(&parser);
    for (size_t i = 0; i + 1u < length; i++) {
        FUZZ_CHECK(encoded[i] != 0u && !impid_frame_parser_push(&parser, encoded[i], &again));
    }
    FUZZ_CHECK(impid_frame_parser_push(&parser, encoded[length - 1u], &again));
    FUZZ_CHECK(again.header.kind == frame->header.kind && again.header.count == frame->header.count &&
               again.header.first_index == frame->header.first_index &&
               again.header.t0_us == frame->header.t0_us &&
               again.header.frame_seq == frame->header.frame_seq);
    FUZZ_CHECK(memcmp(again.records, frame->records, size) == 0);
}

/* The content with its checksum, coded; shorter than the longest frame and one byte. */
static size_t seal(const uint8_t *content, size_t size, uint8_t *encoded) {
    uint8_t raw[IMPID_FRAME_RAW_MAX] = {0};
    size_t length = size < sizeof raw - 4u ? size : sizeof raw - 4u;
    memcpy(raw, content, length);
    uint32_t crc = impid_crc32(raw, length);
    for (uint32_t i = 0; i < 4u; i++) {
        raw[length++] = (uint8_t)(crc >> (8u * i));
    }
    size_t used = impid_cobs_encode(raw, length, encoded);
    encoded[used++] = 0u;
    return used;
}

static void check(const uint8_t *data, size_t size) {
    impid_frame_parser_t parser;
    impid_frame_view_t frame;
    impid_frame_parser_init(&parser);
    uint32_t pieces = 0;
    uint32_t shown = 0;
    bool piece = false;
    for (size_t i = 0; i < size; i++) {
        if (impid_frame_parser_push(&parser, data[i], &frame)) {
            shown++;
            check_sent_again(&frame);
        }
        pieces += data[i] == 0u && piece;
        piece = data[i] != 0u;
        FUZZ_CHECK(parser.frames + parser.damaged + parser.foreign == pieces && parser.frames == shown);
    }
    (void)impid_frame_parser_push(&parser, 0u, &frame);

    const uint8_t record[8] = {1, 0, 3};
    const struct impid_messages_batch_t header = {
        .kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 1};
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    size_t length = impid_frame_encode(&header, record, encoded);
    bool read = false;
    for (size_t i = 0; i < length; i++) {
        read = impid_frame_parser_push(&parser, encoded[i], &frame);
    }
    FUZZ_CHECK(read && memcmp(frame.records, record, sizeof record) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size > 0u && (data[0] & 1u) != 0u) {
        uint8_t sealed[IMPID_FRAME_ENCODED_MAX];
        check(sealed, seal(&data[1], size - 1u, sealed));
    } else if (size > 0u) {
        check(&data[1], size - 1u);
    } else {
        check(data, 0u);
    }
    return 0;
}
