/* The samples of a running stream on their way to the carriers that asked for them.
 *
 * Data flow: impid_stream_sample() takes each sample as it leaves the ring. For the serial line it collects
 * a batch and sends it when it holds ten, before a sample that does not follow on in index and time, when
 * the first has waited 20 ms, or at the end. For CAN it sends ACCEL and ENCODER at once, and TIME and EPOCH
 * of the same sample before them, for the first and then ten times a second. Of a wide sensor ACCEL_FINE goes
 * before ACCEL on CAN, so that ENCODER completes the sample, and behind ENCODER in a serial record.
 * Ownership: the state belongs to the core. Timing: main loop; a batch costs one encoding.
 * Can fail: a carrier without room; counted by the link.
 */
#ifndef IMPID_STREAM_H
#define IMPID_STREAM_H

#include "impid_link.h"
#include "impid_ring.h"

#define IMPID_BATCH_AGE_US     20000u
#define IMPID_BATCH_FLAG_GAP   0x01u /* samples are missing between the batch before and this one */
#define IMPID_CAN_TIME_SAMPLES 100u  /* TIME and EPOCH at 10 Hz */

typedef struct {
    uint8_t records[IMPID_FRAME_RECORDS_MAX];
    uint8_t count;
    uint8_t flags;
    uint32_t first_index;
    uint64_t t0_us;
    uint32_t next_index; /* that would follow the last sample seen */
    uint64_t next_t_us;
    uint16_t boot_id;
    bool wide;               /* of the sensor: samples have an ACCEL_FINE */
    bool on[IMPID_CARRIERS]; /* carriers that asked for the stream */
    bool began;              /* a sample was seen since the stream began */
    bool reset_pending;      /* the next sample is the first since boot */
    uint32_t can_samples_to_time;
} impid_stream_t;

void impid_stream_init(impid_stream_t *stream, uint16_t boot_id, uint32_t first_index, bool wide);
/* A new stream; its first sample has this index. */
void impid_stream_begin(impid_stream_t *stream, uint32_t first_index);
void impid_stream_join(impid_stream_t *stream, impid_carrier_t carrier);
/* Sends what is still collected, if the carrier is the serial line, and leaves. */
void impid_stream_leave(impid_stream_t *stream, impid_carrier_t carrier, impid_link_t *links,
                        const impid_port_t *port);
bool impid_stream_active(const impid_stream_t *stream);
void impid_stream_sample(impid_stream_t *stream, const impid_sample_t *sample, uint64_t t_us,
                         impid_link_t *links, const impid_port_t *port);
/* To be called when the ring is empty: only then has the first sample of a batch waited in vain. */
void impid_stream_flush_aged(impid_stream_t *stream, uint64_t now_us, impid_link_t *links,
                             const impid_port_t *port);

#endif
