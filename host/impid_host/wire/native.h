/* The hot loops of the serial decoder. What they know of the wire comes from
 * the message set, by arguments. */
#ifndef IMPID_WIRE_NATIVE_H
#define IMPID_WIRE_NATIVE_H

/* How a frame is recognised: bytes of header and CRC, where its fields stand,
   the kinds that hold samples, and the sizes of a record of each kind (two at
   most, 0: none). */
typedef struct {
  uint32_t header_bytes, kind_at, version_at, count_at, version, largest;
  uint32_t boot_at, seq_at, index_at, t0_at;
  uint32_t samples, samples_wide, period_us;
  uint32_t record_bytes[256][2];
} impid_frame_layout;

/* What a piece held. joined and overlong go in and come out: a delimiter was
 * seen; within a run too long for a frame. followed counts the frames of samples
 * that impid_follow took. */
typedef struct {
  size_t frames, record_bytes, pending_at, followed;
  uint64_t bad, discarded;
  int32_t joined, overlong;
} impid_deframed;

/* Good frames of data: header after header, record after record, and where each
   frame's records end. The room for records and headers is that of the data,
   for ends one for each header and CRC that fit into it, and one more. scratch
   holds one frame. */
void impid_deframe(const impid_frame_layout *layout, const uint8_t *data,
                   size_t bytes, uint8_t *scratch, uint8_t *headers,
                   uint8_t *records, int64_t *ends, impid_deframed *result);

/* Where a signal lies in its word: shift and mask. */
typedef struct {
  uint32_t shift;
  uint64_t mask;
} impid_signal;

/* ACCEL: ax, ay, index_low16, flags, enc1_high4, enc2_high4. ENCODER:
 * enc1_low28, enc2_low28, index_low8. */
typedef struct {
  impid_signal accel[6], encoder[3];
} impid_sample_layout;

/* Samples of two words. index is what the header says; returns how many
 * contradict it, marked in wrong. */
size_t impid_unpack(const impid_sample_layout *layout, const uint64_t *words,
                    size_t samples, const uint32_t *index, uint8_t flags_kept,
                    uint16_t *ax, uint16_t *ay, int32_t *enc1, int32_t *enc2,
                    uint8_t *flags, uint8_t *wrong);

/* Where a stream stands: the sample and the frame expected next. */
typedef struct {
  uint64_t index, t_us;
  uint16_t boot, seq;
} impid_position;

/* The same as both above, where everything goes on from the position: no
 * damage, no loss, no new run, no wide sample. Returns the samples, or -1 at
 * the first thing else; nothing is to be used then. Frames of other kinds come
 * out as above. block has room for rows samples, a multiple of 8: column after
 * column t_us, index (uint64), seq, enc1, enc2 (32 bits), ax, ay (16), flags.
 */
int64_t impid_follow(const impid_frame_layout *layout,
                     const impid_sample_layout *samples, const uint8_t *data,
                     size_t bytes, uint8_t flags_kept, impid_position *position,
                     uint8_t *block, size_t rows, uint8_t *scratch,
                     uint8_t *headers, uint8_t *records, int64_t *ends,
                     impid_deframed *result);

/* A CAN frame as the recording keeps it. */
typedef struct {
  uint64_t ns;
  uint32_t identifier;
  uint8_t dlc, reserved[3];
  uint64_t word;
} impid_can_frame;

/* Identifiers, and where the signals lie that date a sample. standard: one more
 * than the largest identifier; start: the opcode of START. */
typedef struct {
  uint32_t standard, accel, encoder, fine, time, epoch, response, start;
  uint32_t version, period_us, flag_fine, flag_reset;
  uint64_t apart_ns;
  impid_signal time_us, time_index, epoch_index, epoch_boot, epoch_version,
      opcode;
} impid_can_layout;

/* Where a bus stands: the sample expected next; the date that holds; an ACCEL
 * without its ENCODER and a TIME without its EPOCH, where there are. Of the
 * piece come out: frames that made something, frames of other identifiers,
 * whether it brought a date, whether the last date is behind the last sample. */
typedef struct {
  uint64_t index, t_us, date_us;
  uint32_t date_index;
  uint16_t boot;
  int32_t has_accel, has_time, dated, date_unused;
  uint64_t accel, accel_ns, time;
  int64_t accel_at;
  size_t good, others;
} impid_bus;

/* As impid_follow, of CAN frames: halves that pair, dates that agree, no START,
 * no reset. at (N,) is where the ACCEL of each sample stood (-1: in the piece
 * before), others where the frames of other identifiers. */
int64_t impid_follow_can(const impid_can_layout *layout,
                         const impid_sample_layout *samples,
                         const impid_can_frame *frames, size_t count,
                         uint8_t flags_kept, impid_bus *bus, uint8_t *block,
                         size_t rows, int64_t *at, int64_t *others);
#endif
