#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "native.h"

#define CRC_BYTES 4u
#define CRC_RESIDUE 0x2144DF1Cu
#define COBS_FULL 255u
#define SLICES 16

static uint32_t table[SLICES][256];
static int table_made;

static void make_table(void) {
  for (uint32_t byte = 0; byte < 256; byte++) {
    uint32_t crc = byte;
    for (int bit = 0; bit < 8; bit++) {
      crc = (crc & 1u) ? (crc >> 1) ^ 0xEDB88320u : crc >> 1;
    }
    table[0][byte] = crc;
  }
  for (uint32_t byte = 0; byte < 256; byte++) {
    for (int slice = 1; slice < SLICES; slice++) {
      const uint32_t before = table[slice - 1][byte];
      table[slice][byte] = (before >> 8) ^ table[0][before & 0xFFu];
    }
  }
  table_made = 1;
}

static uint32_t word_at(const uint8_t *at) {
  return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 |
         (uint32_t)at[3] << 24;
}

static uint32_t sliced(uint32_t word, int first) {
  return table[first + 3][word & 0xFFu] ^
         table[first + 2][(word >> 8) & 0xFFu] ^
         table[first + 1][(word >> 16) & 0xFFu] ^ table[first][word >> 24];
}

/* zlib's CRC-32, sixteen bytes at a time. */
static uint32_t crc32_of(const uint8_t *data, size_t bytes) {
  uint32_t crc = 0xFFFFFFFFu;
  for (; bytes >= SLICES; bytes -= SLICES, data += SLICES) {
    crc = sliced(word_at(data) ^ crc, 12) ^ sliced(word_at(data + 4), 8) ^
          sliced(word_at(data + 8), 4) ^ sliced(word_at(data + 12), 0);
  }
  for (; bytes > 0; bytes--, data++) {
    crc = (crc >> 8) ^ table[0][(crc ^ *data) & 0xFFu];
  }
  return crc ^ 0xFFFFFFFFu;
}

/* The same of less than 255 bytes, where no code stands for a full block: one
 * copy, then a zero for each code. */
static size_t cobs_decode_short(const uint8_t *data, size_t bytes,
                                uint8_t *out) {
  memcpy(out, data + 1, bytes - 1);
  size_t at = data[0];
  while (at < bytes) {
    out[at - 1] = 0;
    at += data[at];
  }
  return at == bytes ? bytes - 1 : 0;
}

/* Bytes that a frame without its delimiter decodes to; 0 if it is damaged. It
 * holds no zero byte. */
static size_t cobs_decode(const uint8_t *data, size_t bytes, uint8_t *out) {
  if (bytes < COBS_FULL) {
    return cobs_decode_short(data, bytes, out);
  }
  size_t at = 0, made = 0;
  while (at < bytes) {
    const size_t code = data[at], copied = code - 1u;
    at++;
    if (copied > bytes - at) {
      return 0;
    }
    memcpy(out + made, data + at, copied);
    at += copied;
    made += copied;
    if (at < bytes && code != COBS_FULL) {
      out[made++] = 0;
    }
  }
  return made;
}

static int is_good(const impid_frame_layout *layout, const uint8_t *raw,
                   size_t bytes) {
  if (bytes < layout->header_bytes + CRC_BYTES ||
      crc32_of(raw, bytes) != CRC_RESIDUE ||
      raw[layout->version_at] != layout->version) {
    return 0;
  }
  const size_t records = bytes - layout->header_bytes - CRC_BYTES;
  const uint32_t *sizes = layout->record_bytes[raw[layout->kind_at]];
  for (int n = 0; n < 2; n++) {
    if (sizes[n] != 0 && records == (size_t)raw[layout->count_at] * sizes[n]) {
      return 1;
    }
  }
  return 0;
}

void impid_deframe(const impid_frame_layout *layout, const uint8_t *data,
                   size_t bytes, uint8_t *scratch, uint8_t *headers,
                   uint8_t *records, int64_t *ends, impid_deframed *result) {
  if (!table_made) {
    make_table();
  }
  size_t at = 0;
  while (at < bytes) {
    const uint8_t *end = memchr(data + at, 0, bytes - at);
    if (end == NULL) {
      break;
    }
    const size_t length = (size_t)(end - (data + at));
    size_t raw = 0;
    /* A frame that is too long for any kind would not fit the scratch, and is
     * damaged. */
    if (length > 0 && length <= layout->largest && !result->overlong) {
      raw = cobs_decode(data + at, length, scratch);
    }
    if (raw > 0 && is_good(layout, scratch, raw)) {
      const size_t body = raw - layout->header_bytes - CRC_BYTES;
      memcpy(headers + result->frames * layout->header_bytes, scratch,
             layout->header_bytes);
      memcpy(records + result->record_bytes, scratch + layout->header_bytes,
             body);
      result->record_bytes += body;
      ends[result->frames++] = (int64_t)result->record_bytes;
    } else if (length > 0 || result->overlong) {
      result->discarded += length;
      result->bad += result->joined ? 1u : 0u;
    }
    result->joined = 1;
    result->overlong = 0;
    at += length + 1;
  }
  result->pending_at = at;
}

static uint64_t signal_of(const impid_signal *signal, uint64_t word) {
  return (word >> signal->shift) & signal->mask;
}

size_t impid_unpack(const impid_sample_layout *layout, const uint64_t *words,
                    size_t samples, const uint32_t *index, uint8_t flags_kept,
                    uint16_t *ax, uint16_t *ay, int32_t *enc1, int32_t *enc2,
                    uint8_t *flags, uint8_t *wrong) {
  const impid_sample_layout where = *layout;
  size_t contradict = 0;
  for (size_t i = 0; i < samples; i++) {
    const uint64_t accel = words[2 * i], encoder = words[2 * i + 1];
    ax[i] = (uint16_t)signal_of(&where.accel[0], accel);
    ay[i] = (uint16_t)signal_of(&where.accel[1], accel);
    flags[i] = (uint8_t)(signal_of(&where.accel[3], accel) & flags_kept);
    const uint32_t first = (uint32_t)(signal_of(&where.accel[4], accel) << 28 |
                                      signal_of(&where.encoder[0], encoder));
    const uint32_t second = (uint32_t)(signal_of(&where.accel[5], accel) << 28 |
                                       signal_of(&where.encoder[1], encoder));
    memcpy(&enc1[i], &first, sizeof first);
    memcpy(&enc2[i], &second, sizeof second);
    wrong[i] = (uint8_t)(signal_of(&where.accel[2], accel) !=
                             (index[i] & where.accel[2].mask) ||
                         signal_of(&where.encoder[2], encoder) !=
                             (index[i] & where.encoder[2].mask));
    contradict += wrong[i];
  }
  return contradict;
}
