/* Which exception runs, which wait, and which may enter (PM0214 2.3.5, 2.3.6, 4.3.9). */
#include "chip.h"

static int has(const uint32_t *bits, uint32_t n) {
    return (int)(bits[n / 32] >> n % 32 & 1u);
}

void nvic_pend(chip *c, uint32_t exception) {
    c->pending[exception / 32] |= 1u << exception % 32;
    c->clock.deadline = 0;
}

void nvic_set_line(chip *c, uint32_t irq, int high) {
    const uint32_t exception = FIRST_IRQ + irq;
    const uint32_t bit = 1u << exception % 32;
    uint32_t *word = &c->lines[exception / 32];
    if (!high) {
        *word &= ~bit;
    } else if ((*word & bit) == 0) {
        *word |= bit;
        nvic_pend(c, exception);
    }
}

int32_t nvic_priority(const chip *c, uint32_t exception) {
    return exception == 2 ? -2 : exception == 3 ? -1 : (int32_t)c->priority[exception];
}

int32_t nvic_execution_priority(const chip *c) {
    int32_t most = THREAD;
    for (uint32_t n = 0; n < c->nested; ++n) {
        const int32_t priority = nvic_priority(c, c->active[n]);
        most = priority < most ? priority : most;
    }
    return most;
}

int nvic_any_pending(const chip *c) {
    return (c->pending[0] | c->pending[1] | c->pending[2] | c->pending[3]) != 0;
}

/* Of equals the lower number. */
int32_t nvic_candidate(const chip *c) {
    if (!nvic_any_pending(c)) {
        return -1;
    }
    int32_t best = -1;
    int32_t best_priority = nvic_execution_priority(c);
    for (uint32_t n = 0; n < EXCEPTIONS; ++n) {
        if ((c->pending[n / 32] & c->enabled[n / 32]) == 0) {
            n |= 31; /* none of these 32 */
        } else if (has(c->pending, n) && has(c->enabled, n) && nvic_priority(c, n) < best_priority) {
            best = (int32_t)n;
            best_priority = nvic_priority(c, n);
        }
    }
    return best;
}
