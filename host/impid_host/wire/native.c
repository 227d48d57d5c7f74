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

/* The next frame: its records' bytes and more in scratch (0: damaged or empty),
 * length is that on the line. NULL: no whole one is left. */
static const uint8_t *next_frame(const impid_frame_layout *layout,
                                 const uint8_t *data, size_t bytes,
                                 uint8_t *scratch, size_t *length,
                                 size_t *raw) {
  const uint8_t *end = memchr(data, 0, bytes);
  if (end == NULL) {
    return NULL;
  }
  *length = (size_t)(end - data);
  *raw = 0;
  /* A frame that is too long for any kind would not fit the scratch, and is
   * damaged. */
  if (*length > 0 && *length <= layout->largest) {
    *raw = cobs_decode(data, *length, scratch);
  }
  if (*raw > 0 && !is_good(layout, scratch, *raw)) {
    *raw = 0;
  }
  return end + 1;
}

static void keep_frame(const impid_frame_layout *layout, const uint8_t *frame,
                       size_t raw, uint8_t *headers, uint8_t *records,
                       int64_t *ends, impid_deframed *result) {
  const size_t body = raw - layout->header_bytes - CRC_BYTES;
  memcpy(headers + result->frames * layout->header_bytes, frame,
         layout->header_bytes);
  memcpy(records + result->record_bytes, frame + layout->header_bytes, body);
  result->record_bytes += body;
  ends[result->frames++] = (int64_t)result->record_bytes;
}

void impid_deframe(const impid_frame_layout *layout, const uint8_t *data,
                   size_t bytes, uint8_t *scratch, uint8_t *headers,
                   uint8_t *records, int64_t *ends, impid_deframed *result) {
  if (!table_made) {
    make_table();
  }
  const uint8_t *at = data, *behind;
  size_t length, raw;
  while ((behind = next_frame(layout, at, bytes - (size_t)(at - data), scratch,
                              &length, &raw)) != NULL) {
    if (raw > 0 && !result->overlong) {
      keep_frame(layout, scratch, raw, headers, records, ends, result);
    } else if (length > 0 || result->overlong) {
      result->discarded += length;
      result->bad += result->joined ? 1u : 0u;
    }
    result->joined = 1;
    result->overlong = 0;
    at = behind;
  }
  result->pending_at = (size_t)(at - data);
}

static uint64_t signal_of(const impid_signal *signal, uint64_t word) {
  return (word >> signal->shift) & signal->mask;
}

typedef struct {
  uint64_t *t_us, *index;
  uint32_t *seq;
  int32_t *enc1, *enc2;
  uint16_t *ax, *ay;
  uint8_t *flags;
} columns;

static void unpack_one(const impid_sample_layout *where, uint64_t accel,
                       uint64_t encoder, uint8_t flags_kept,
                       const columns *out, size_t i) {
  out->ax[i] = (uint16_t)signal_of(&where->accel[0], accel);
  out->ay[i] = (uint16_t)signal_of(&where->accel[1], accel);
  out->flags[i] = (uint8_t)(signal_of(&where->accel[3], accel) & flags_kept);
  const uint32_t first = (uint32_t)(signal_of(&where->accel[4], accel) << 28 |
                                    signal_of(&where->encoder[0], encoder));
  const uint32_t second = (uint32_t)(signal_of(&where->accel[5], accel) << 28 |
                                     signal_of(&where->encoder[1], encoder));
  memcpy(&out->enc1[i], &first, sizeof first);
  memcpy(&out->enc2[i], &second, sizeof second);
}

static int contradicts(const impid_sample_layout *where, uint64_t accel,
                       uint64_t encoder, uint32_t index) {
  return signal_of(&where->accel[2], accel) != (index & where->accel[2].mask) ||
         signal_of(&where->encoder[2], encoder) !=
             (index & where->encoder[2].mask);
}

size_t impid_unpack(const impid_sample_layout *layout, const uint64_t *words,
                    size_t samples, const uint32_t *index, uint8_t flags_kept,
                    uint16_t *ax, uint16_t *ay, int32_t *enc1, int32_t *enc2,
                    uint8_t *flags, uint8_t *wrong) {
  const impid_sample_layout where = *layout;
  const columns out = {NULL, NULL, NULL, enc1, enc2, ax, ay, flags};
  size_t contradict = 0;
  for (size_t i = 0; i < samples; i++) {
    const uint64_t accel = words[2 * i], encoder = words[2 * i + 1];
    unpack_one(&where, accel, encoder, flags_kept, &out, i);
    wrong[i] = (uint8_t)contradicts(&where, accel, encoder, index[i]);
    contradict += wrong[i];
  }
  return contradict;
}

static columns columns_in(uint8_t *block, size_t rows) {
  columns out;
  out.t_us = (uint64_t *)(void *)block;
  out.index = out.t_us + rows;
  out.seq = (uint32_t *)(void *)(out.index + rows);
  out.enc1 = (int32_t *)(void *)(out.seq + rows);
  out.enc2 = out.enc1 + rows;
  out.ax = (uint16_t *)(void *)(out.enc2 + rows);
  out.ay = out.ax + rows;
  out.flags = (uint8_t *)(void *)(out.ay + rows);
  return out;
}

static int stands_at(const impid_frame_layout *layout, const uint8_t *frame,
                     const impid_position *position) {
  uint16_t boot, seq;
  memcpy(&boot, frame + layout->boot_at, sizeof boot);
  memcpy(&seq, frame + layout->seq_at, sizeof seq);
  return boot == position->boot && seq == position->seq;
}

/* The samples of a frame behind the first `made`; how many, or 0 if they are
 * not those that come next. */
static size_t append(const impid_frame_layout *layout,
                     const impid_sample_layout *where, const uint8_t *frame,
                     uint8_t flags_kept, impid_position *position,
                     const columns *out, size_t made) {
  uint64_t t0_us;
  memcpy(&t0_us, frame + layout->t0_at, sizeof t0_us);
  if (word_at(frame + layout->index_at) != (uint32_t)position->index ||
      t0_us != position->t_us) {
    return 0;
  }
  const size_t count = frame[layout->count_at];
  const uint8_t *record = frame + layout->header_bytes;
  for (size_t n = 0; n < count; n++, record += 16) {
    uint64_t accel, encoder;
    memcpy(&accel, record, sizeof accel);
    memcpy(&encoder, record + 8, sizeof encoder);
    const uint64_t index = position->index + n;
    if (contradicts(where, accel, encoder, (uint32_t)index)) {
      return 0;
    }
    out->index[made + n] = index;
    out->seq[made + n] = (uint32_t)index;
    out->t_us[made + n] = t0_us + n * layout->period_us;
    unpack_one(where, accel, encoder, flags_kept, out, made + n);
  }
  position->index += count;
  position->t_us += count * layout->period_us;
  return count;
}

int64_t impid_follow(const impid_frame_layout *layout,
                     const impid_sample_layout *samples, const uint8_t *data,
                     size_t bytes, uint8_t flags_kept, impid_position *position,
                     uint8_t *block, size_t rows, uint8_t *scratch,
                     uint8_t *headers, uint8_t *records, int64_t *ends,
                     impid_deframed *result) {
  if (!table_made) {
    make_table();
  }
  const impid_sample_layout where = *samples;
  const columns out = columns_in(block, rows);
  const uint8_t *at = data, *behind;
  size_t length, raw, made = 0;
  while ((behind = next_frame(layout, at, bytes - (size_t)(at - data), scratch,
                              &length, &raw)) != NULL) {
    at = behind;
    if (length == 0) {
      continue;
    }
    if (raw == 0 || scratch[layout->kind_at] == layout->samples_wide ||
        !stands_at(layout, scratch, position)) {
      return -1;
    }
    position->seq++;
    if (scratch[layout->kind_at] != layout->samples) {
      keep_frame(layout, scratch, raw, headers, records, ends, result);
      continue;
    }
    const size_t more = append(layout, &where, scratch, flags_kept, position,
                               &out, made);
    if (more == 0) {
      return -1;
    }
    result->followed++;
    made += more;
  }
  result->pending_at = (size_t)(at - data);
  return (int64_t)made;
}

/* Takes the EPOCH behind a TIME; 0: it does not agree with the date that holds. */
static int date_agrees(const impid_can_layout *layout, impid_bus *bus,
                       uint64_t word) {
  const uint32_t index = (uint32_t)signal_of(&layout->epoch_index, word);
  const uint64_t t_us = signal_of(&layout->time_us, bus->time);
  const uint32_t since = index - bus->date_index;
  if (!bus->has_time ||
      signal_of(&layout->time_index, bus->time) !=
          (index & layout->time_index.mask) ||
      signal_of(&layout->epoch_version, word) != layout->version ||
      signal_of(&layout->epoch_boot, word) != bus->boot ||
      t_us != bus->date_us + (uint64_t)since * layout->period_us) {
    return 0;
  }
  bus->has_time = 0;
  bus->date_index = index;
  bus->date_us = t_us;
  bus->good += 2;
  bus->dated = bus->date_unused = 1;
  return 1;
}

/* The sample of two halves; 0: it is not the one that comes next. */
static int append_halves(const impid_can_layout *layout,
                         const impid_sample_layout *where, impid_bus *bus,
                         const impid_can_frame *second, uint8_t flags_kept,
                         const columns *out, size_t made) {
  const uint32_t index = (uint32_t)bus->index;
  const uint64_t flags = signal_of(&where->accel[3], bus->accel);
  /* Half the range of the low bits around the date: beyond it they are
   * ambiguous. */
  const uint32_t since = index - bus->date_index + 0x8000u;
  if (contradicts(where, bus->accel, second->word, index) ||
      (flags & (layout->flag_fine | layout->flag_reset)) != 0 ||
      since >= 0x10000u || second->ns - bus->accel_ns >= layout->apart_ns) {
    return 0;
  }
  const uint64_t dated_us =
      bus->date_us + since * (uint64_t)layout->period_us -
      0x8000u * (uint64_t)layout->period_us;
  if (dated_us != bus->t_us) {
    return 0;
  }
  out->index[made] = bus->index;
  out->seq[made] = index;
  out->t_us[made] = bus->t_us;
  unpack_one(where, bus->accel, second->word, flags_kept, out, made);
  bus->index++;
  bus->t_us += layout->period_us;
  bus->has_accel = 0;
  bus->good += 2;
  return 1;
}

int64_t impid_follow_can(const impid_can_layout *layout,
                         const impid_sample_layout *samples,
                         const impid_can_frame *frames, size_t count,
                         uint8_t flags_kept, impid_bus *bus, uint8_t *block,
                         size_t rows, int64_t *at, int64_t *others) {
  const impid_sample_layout where = *samples;
  const impid_can_layout known = *layout;
  const columns out = columns_in(block, rows);
  size_t made = 0;
  int64_t epoch_at = -1;
  for (size_t i = 0; i < count; i++) {
    const impid_can_frame *frame = &frames[i];
    if (frame->identifier >= known.standard || frame->dlc != 8) {
      continue;
    }
    if (frame->identifier == known.accel) {
      if (bus->has_accel) {
        return -1;
      }
      bus->has_accel = 1;
      bus->accel = frame->word;
      bus->accel_ns = frame->ns;
      bus->accel_at = (int64_t)i;
    } else if (frame->identifier == known.encoder) {
      if (!bus->has_accel || !append_halves(&known, &where, bus, frame,
                                            flags_kept, &out, made)) {
        return -1;
      }
      if (bus->accel_at >= epoch_at) {
        bus->date_unused = 0;
      }
      at[made++] = bus->accel_at;
    } else if (frame->identifier == known.time) {
      bus->has_time = 1;
      bus->time = frame->word;
    } else if (frame->identifier == known.epoch) {
      if (!date_agrees(&known, bus, frame->word)) {
        return -1;
      }
      epoch_at = (int64_t)i;
    } else if (frame->identifier == known.fine ||
               (frame->identifier == known.response &&
                signal_of(&known.opcode, frame->word) == known.start)) {
      return -1;
    } else {
      others[bus->others++] = (int64_t)i;
    }
  }
  return (int64_t)made;
}
