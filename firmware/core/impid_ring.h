/* The samples on their way from the sampling interrupt to the main loop: a ring with one producer and
 * one consumer that counts exactly what it could not take.
 *
 * Data flow: impid_ring_push() by the interrupt, impid_ring_pop() by the main loop, oldest first. A full
 * ring refuses the new sample (a producer must not take what the consumer may be reading) and counts it.
 * Ownership: slots belong to the ring; samples are copied in and out.
 * Concurrency: `head` is written by the producer alone, `tail` by the consumer alone, both free-running
 * 32-bit numbers; release/acquire orders the slot's content with the index that publishes it. clear() is
 * only for a moment when the producer does not push.
 * Timing: constant. Can fail: push on a full ring (counted in `lost`), pop on an empty one.
 */
#ifndef IMPID_RING_H
#define IMPID_RING_H

#include "impid_sensor.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define IMPID_RING_SAMPLES 256u /* a power of two: 256 ms of a stalled main loop */

typedef struct {
    uint32_t index;
    uint32_t t_us; /* low half of the board's time */
    uint32_t encoder[2];
    uint16_t accel[IMPID_AXES_MAX]; /* codes of 16 bits, or the upper 16 of codes of 24, */
    uint8_t fine[IMPID_AXES_MAX];   /* of which these are the lower 8 */
    uint8_t flags;                  /* IMPID_FLAG_* */
} impid_sample_t;

typedef struct {
    impid_sample_t slots[IMPID_RING_SAMPLES];
    _Atomic uint32_t head; /* samples ever pushed */
    _Atomic uint32_t tail; /* samples ever popped */
    _Atomic uint32_t lost; /* samples refused since the last clear */
} impid_ring_t;

void impid_ring_clear(impid_ring_t *ring);
bool impid_ring_push(impid_ring_t *ring, const impid_sample_t *sample);
bool impid_ring_pop(impid_ring_t *ring, impid_sample_t *sample);
uint32_t impid_ring_lost(const impid_ring_t *ring);

#endif
