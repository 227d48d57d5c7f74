/* Consistent overhead byte stuffing (Cheshire and Baker 1999): bytes without zeros, so that a zero can
 * end a frame.
 *
 * Data flow: bytes in, bytes out, without the delimiter. Ownership: the caller's buffers; encode must
 * not overlap, decode works in place. Timing: one pass. Can fail: decode on a zero inside or a block
 * longer than what is left; returns 0, which no valid frame of ours has as its length.
 */
#ifndef IMPID_COBS_H
#define IMPID_COBS_H

#include <stddef.h>
#include <stdint.h>

/* Room that `count` bytes may need when encoded. */
#define IMPID_COBS_ENCODED_MAX(count) ((count) + 1u + (count) / 254u)

size_t impid_cobs_encode(const uint8_t *bytes, size_t count, uint8_t *encoded);
size_t impid_cobs_decode(uint8_t *bytes, size_t count);

#endif
