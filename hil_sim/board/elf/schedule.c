/* Events in order of time; those of one cycle in the order in which they were asked for.
 *
 * Cycles of the processor's clock are the base because everything on the buses counts them exactly. What
 * follows another clock keeps its instant in seconds, and gets another cycle when the processor's clock
 * changes.
 */
#include "chip.h"

#include <math.h>
#include <stdlib.h>

static int before(const event *a, const event *b) {
    return a->cycle != b->cycle ? a->cycle < b->cycle : a->order < b->order;
}

static void sift_up(chip *c, size_t place) {
    event *moving = c->heap[place];
    while (place > 0) {
        const size_t parent = (place - 1) / 2;
        if (!before(moving, c->heap[parent])) {
            break;
        }
        c->heap[place] = c->heap[parent];
        place = parent;
    }
    c->heap[place] = moving;
}

static void sift_down(chip *c, size_t place) {
    event *moving = c->heap[place];
    for (;;) {
        size_t child = 2 * place + 1;
        if (child >= c->events) {
            break;
        }
        if (child + 1 < c->events && before(c->heap[child + 1], c->heap[child])) {
            ++child;
        }
        if (!before(c->heap[child], moving)) {
            break;
        }
        c->heap[place] = c->heap[child];
        place = child;
    }
    c->heap[place] = moving;
}

static event *push(chip *c, event wanted) {
    if (c->events == c->room) {
        c->room = c->room == 0 ? 64 : 2 * c->room;
        c->heap = realloc(c->heap, c->room * sizeof *c->heap);
    }
    event *e = malloc(sizeof *e);
    if (e == NULL || c->heap == NULL) {
        abort();
    }
    *e = wanted;
    e->order = c->ordered++;
    c->heap[c->events] = e;
    sift_up(c, c->events++);
    return e;
}

static event *pop(chip *c) {
    event *first = c->heap[0];
    c->heap[0] = c->heap[--c->events];
    if (c->events > 0) {
        sift_down(c, 0);
    }
    return first;
}

double schedule_seconds(const chip *c) {
    return c->base_seconds + (double)(c->now - c->base_cycle) / c->frequency;
}

event *schedule_at(chip *c, uint64_t cycle, event_act act, void *owner, uint64_t detail) {
    return push(c, (event){.cycle = cycle, .seconds = -1.0, .act = act, .owner = owner, .detail = detail});
}

/* At least one cycle from now. */
event *schedule_after_seconds(chip *c, double delay, event_act act, void *owner, uint64_t detail) {
    const double cycles = nearbyint(delay * c->frequency);
    return push(c, (event){.cycle = c->now + (cycles < 1.0 ? 1u : (uint64_t)cycles),
                           .seconds = schedule_seconds(c) + delay,
                           .act = act,
                           .owner = owner,
                           .detail = detail});
}

static void call_python(chip *c, void *owner, uint64_t number) {
    (void)owner;
    chip_event(c, number);
}

event *schedule_python(chip *c, uint64_t cycle, uint64_t number) {
    return schedule_at(c, cycle, call_python, NULL, number);
}

event *schedule_python_after_seconds(chip *c, double delay, uint64_t number) {
    return schedule_after_seconds(c, delay, call_python, NULL, number);
}

void schedule_cancel(event *e) {
    e->act = NULL;
}

uint64_t schedule_next(chip *c) {
    while (c->events > 0 && c->heap[0]->act == NULL) {
        free(pop(c));
    }
    return c->events > 0 ? c->heap[0]->cycle : UINT64_MAX;
}

/* The event is given back first: its owner may ask for another one. */
static void happen(chip *c, event *e) {
    const event now = *e;
    free(e);
    if (now.act != NULL) {
        c->now = now.cycle > c->now ? now.cycle : c->now;
        now.act(c, now.owner, now.detail);
    }
}

void schedule_fire(chip *c, uint64_t until) {
    while (c->events > 0 && c->heap[0]->cycle <= until && !c->failed) {
        happen(c, pop(c));
    }
    c->now = until > c->now ? until : c->now;
}

/* Ends after the event that makes something pending; returns the cycle reached. */
uint64_t schedule_fire_while_quiet(chip *c, uint64_t until) {
    while (!nvic_any_pending(c) && !c->failed && c->events > 0 && c->heap[0]->cycle <= until) {
        happen(c, pop(c));
    }
    if (!nvic_any_pending(c)) {
        c->now = until;
    }
    return c->now;
}

/* Begins at a cycle and a time other than zero, with nothing to happen: the chip was reset, the world goes
 * on. */
void schedule_start(chip *c, uint64_t cycle, double seconds, double frequency) {
    while (c->events > 0) {
        free(pop(c));
    }
    c->now = c->base_cycle = cycle;
    c->base_seconds = seconds;
    c->frequency = frequency;
}

void schedule_set_frequency(chip *c, double frequency) {
    c->base_seconds = schedule_seconds(c);
    c->base_cycle = c->now;
    c->frequency = frequency;
    for (size_t n = 0; n < c->events; ++n) {
        event *e = c->heap[n];
        if (e->seconds >= 0.0) {
            const double cycles = nearbyint((e->seconds - c->base_seconds) * frequency);
            e->cycle = c->base_cycle + (cycles > 0.0 ? (uint64_t)cycles : 0u);
        }
    }
    for (size_t n = c->events / 2; n-- > 0;) {
        sift_down(c, n);
    }
}
