#include "impid_ring.h"

#include "impid_assert.h"

_Static_assert((IMPID_RING_SAMPLES & (IMPID_RING_SAMPLES - 1u)) == 0u, "free-running indices need it");

void impid_ring_clear(impid_ring_t *ring) {
    atomic_store(&ring->head, 0u);
    atomic_store(&ring->tail, 0u);
    atomic_store(&ring->lost, 0u);
}

bool impid_ring_push(impid_ring_t *ring, const impid_sample_t *sample) {
    /* Only this context writes head, so a relaxed read is exact. The consumer may advance tail meanwhile:
     * the old value only makes the ring look fuller than it is, never emptier. */
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    IMPID_ASSERT(head - tail <= IMPID_RING_SAMPLES);
    if (head - tail == IMPID_RING_SAMPLES) {
        uint32_t lost = atomic_load_explicit(&ring->lost, memory_order_relaxed);
        atomic_store_explicit(&ring->lost, lost + 1u, memory_order_relaxed);
        return false;
    }
    ring->slots[head % IMPID_RING_SAMPLES] = *sample;
    atomic_store_explicit(&ring->head, head + 1u, memory_order_release);
    return true;
}

bool impid_ring_pop(impid_ring_t *ring, impid_sample_t *sample) {
    uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    uint32_t head = atomic_load_explicit(&ring->head, memory_order_acquire);
    IMPID_ASSERT(head - tail <= IMPID_RING_SAMPLES);
    if (head == tail) {
        return false;
    }
    *sample = ring->slots[tail % IMPID_RING_SAMPLES];
    atomic_store_explicit(&ring->tail, tail + 1u, memory_order_release);
    return true;
}

uint32_t impid_ring_lost(const impid_ring_t *ring) {
    return atomic_load_explicit(&ring->lost, memory_order_relaxed);
}
