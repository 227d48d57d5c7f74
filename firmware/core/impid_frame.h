/* Frames of the serial line: COBS(BATCH header | records | CRC-32) and a zero byte.
 *
 * Data flow: impid_frame_encode() makes one frame out of a header and its records. The parser takes bytes
 * one by one and shows each frame whose coding, checksum, version, kind and length all hold; whatever does
 * not is dropped up to the next zero byte and counted by cause. Bytes before the first delimiter after an
 * oversized frame belong to that frame.
 * Ownership: the parser's buffer holds the frame shown, until the next byte is pushed.
 * Timing: main loop; constant a byte, and one pass over at most 265 bytes at a delimiter.
 * Can fail: encode never (the caller's count fits by IMPID_FRAME_RECORDS_MAX); the parser says so by its
 * counters.
 */
#ifndef IMPID_FRAME_H
#define IMPID_FRAME_H

#include "impid_cobs.h"
#include "impid_messages.h"
#include "impid_sensor.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IMPID_PROTOCOL_VERSION 1u
#define IMPID_BATCH_SAMPLES    10u

#define IMPID_RECORD_SAMPLE      (IMPID_MESSAGES_ACCEL_LENGTH + IMPID_MESSAGES_ENCODER_LENGTH)
#define IMPID_RECORD_SAMPLE_WIDE (IMPID_RECORD_SAMPLE + IMPID_MESSAGES_ACCEL_FINE_LENGTH)
/* A build for two axes never makes a wide sample, and to take one in is nobody's business but a test's. */
#if IMPID_AXES_MAX > 2u
#define IMPID_RECORD_SAMPLE_MAX IMPID_RECORD_SAMPLE_WIDE
#else
#define IMPID_RECORD_SAMPLE_MAX IMPID_RECORD_SAMPLE
#endif
#define IMPID_FRAME_RECORDS_MAX (IMPID_BATCH_SAMPLES * IMPID_RECORD_SAMPLE_MAX)
#define IMPID_FRAME_RAW_MAX     (IMPID_MESSAGES_BATCH_LENGTH + IMPID_FRAME_RECORDS_MAX + 4u)
#define IMPID_FRAME_ENCODED_MAX (IMPID_COBS_ENCODED_MAX(IMPID_FRAME_RAW_MAX) + 1u)

/* Bytes of one record of a kind; 0 for a kind that does not exist. */
size_t impid_frame_record_size(uint8_t kind);

/* `out` holds IMPID_FRAME_ENCODED_MAX bytes; returns how many are used, delimiter included. */
size_t impid_frame_encode(const struct impid_messages_batch_t *header, const uint8_t *records, uint8_t *out);

typedef struct {
    uint8_t buffer[IMPID_FRAME_ENCODED_MAX];
    size_t length;    /* bytes of the frame so far; beyond the buffer they are counted, not kept */
    uint32_t frames;  /* whole and valid */
    uint32_t damaged; /* bad coding, length or checksum */
    uint32_t foreign; /* checksum right, but a version, kind or count that does not exist here */
} impid_frame_parser_t;

typedef struct {
    struct impid_messages_batch_t header;
    const uint8_t *records;
} impid_frame_view_t;

void impid_frame_parser_init(impid_frame_parser_t *parser);
/* true: `frame` shows a valid frame that ended with this byte. */
bool impid_frame_parser_push(impid_frame_parser_t *parser, uint8_t byte, impid_frame_view_t *frame);

#endif
