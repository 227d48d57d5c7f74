/* Counting, captures and triggers of the general-purpose timers (chapters 17, 18); configuration is
 * timer.py's.
 *
 * Counting is lazy: a running counter is its value at a known cycle plus the cycles since. Only what others
 * can notice (an update, a trigger) is an event.
 */
#include "chip.h"

#include <stdio.h>

enum {
    CR1 = 0,
    CR2 = 1,
    SMCR = 2,
    DIER = 3,
    SR = 4,
    CCMR1 = 6,
    CCER = 8,
    CNT = 9,
    PSC = 10,
    ARR = 11,
    CCR1 = 13
};
enum { CEN = 1, DIR = 1 << 4 };
enum { INTERNAL = 0, ENCODER_BOTH = 3, TRIGGER = 6, EXTERNAL = 7 };
enum { MMS_UPDATE = 2, UIF = 1 };
enum { FOLLOWS_NOTHING, FOLLOWS_WORLD, FOLLOWS_PYTHON };

static uint32_t mode(const timer *t) {
    return t->reg[SMCR] & 7u;
}

static int encoder(const timer *t) {
    return mode(t) >= 1 && mode(t) <= 3;
}

/* Processor cycles a count. */
static uint64_t step(const timer *t) {
    return (uint64_t)t->bank.chip->timer_divider * (t->psc + 1u);
}

void timer_update_line(timer *t) {
    nvic_set_line(t->bank.chip, t->irq, (t->reg[SR] & t->reg[DIER] & 0x1Fu) != 0);
}

static void set_flag(timer *t, uint32_t bits) {
    t->reg[SR] |= bits;
    if ((t->reg[DIER] & 0x1Fu) != 0) {
        timer_update_line(t);
    }
}

/* --- triggers and captures ----------------------------------------------------------------------- */

/* CCRx takes CNT; a second capture before the first was read sets CCxOF (17.3.6). */
void timer_capture(timer *t, uint32_t channel) {
    if ((t->reg[CCER] >> 4 * (channel - 1) & 1u) == 0) {
        return;
    }
    t->reg[CCR1 + channel - 1] = (uint32_t)timer_count(t);
    if ((t->reg[SR] >> channel & 1u) != 0) {
        t->reg[SR] |= 1u << (8 + channel);
    }
    set_flag(t, 1u << channel);
    if ((t->reg[DIER] >> (8 + channel) & 1u) == 0) {
        return;
    }
    if (channel == 3 && (t->number == TIM2 || t->number == TIM5)) {
        (void)dma_request(t->bank.chip, t->number == TIM2 ? REQUEST_TIM2_CH3 : REQUEST_TIM5_CH3);
    } else {
        chip_violate(t->bank.chip, t->bank.name, "9.3.3", "a capture whose DMA request has no model");
    }
}

/* One edge of an external clock (external clock mode 1, 17.3.3). */
static void tick(timer *t) {
    if (++t->count > t->arr) {
        t->count = 0;
        timer_update(t, 1);
    }
}

/* A rising edge of TRGI, and of TRC behind it. */
static void trigger(timer *t) {
    for (uint32_t channel = 1; channel <= 4; ++channel) {
        if ((t->trc_channels >> channel & 1u) != 0) {
            timer_capture(t, channel);
        }
    }
    if (mode(t) == TRIGGER && (t->reg[CR1] & CEN) == 0) {
        t->reg[CR1] |= CEN;
        timer_restart(t, t->count);
    } else if (mode(t) == EXTERNAL && (t->reg[CR1] & CEN) != 0) {
        tick(t);
    }
}

/* A trigger output rises: it starts conversions and triggers other timers. */
static void rise(chip *c, uint32_t number) {
    adc_trigger(c->adc, (int32_t)number);
    for (int n = 0; n < TIMERS; ++n) {
        if (c->timers[n]->source == (int32_t)number) {
            trigger(c->timers[n]);
        }
    }
}

/* Update event (17.3.2): preload registers, UIF, trigger output. */
void timer_update(timer *t, int flag) {
    t->psc = t->reg[PSC];
    t->arr = t->reg[ARR];
    if (flag) {
        set_flag(t, UIF);
    }
    if ((t->reg[CR2] >> 4 & 7u) == MMS_UPDATE) {
        rise(t->bank.chip, t->number);
    }
}

/* --- counting ------------------------------------------------------------------------------------ */

static void overflows(chip *c, void *owner, uint64_t detail) {
    timer *t = owner;
    (void)c;
    (void)detail;
    t->overflow = NULL;
    timer_update(t, 1);
    timer_restart(t, 0);
}

/* Counting goes on from a value at this instant, with an empty prescaler. */
void timer_restart(timer *t, uint64_t count) {
    chip *c = t->bank.chip;
    t->count = count;
    t->since = c->now;
    if (t->overflow != NULL) {
        schedule_cancel(t->overflow);
        t->overflow = NULL;
    }
    if ((t->reg[CR1] & CEN) == 0 || (mode(t) != INTERNAL && mode(t) != TRIGGER)) {
        return;
    }
    if (count > t->arr) {
        char text[64];
        (void)snprintf(text, sizeof text, "CNT %llu is above ARR %u", (unsigned long long)count, t->arr);
        chip_violate(c, t->bank.name, "17.3.2", text);
        return;
    }
    t->overflow = schedule_at(c, c->now + ((uint64_t)t->arr + 1u - count) * step(t), overflows, t, 0);
}

/* CNT moves within 0..ARR; passing an end is an update event. */
void timer_turn(timer *t, int64_t counts) {
    if (counts == 0) {
        return;
    }
    const int64_t size = (int64_t)t->arr + 1;
    const int64_t raw = (int64_t)t->count + counts;
    const int64_t wrapped = (raw % size + size) % size;
    t->count = (uint64_t)wrapped;
    t->reg[CR1] = (t->reg[CR1] & ~(uint32_t)DIR) | (counts < 0 ? (uint32_t)DIR : 0u);
    if (raw != wrapped) {
        timer_update(t, 1);
    }
}

static uint32_t inverted(const timer *t, uint32_t channel) {
    return t->reg[CCER] >> (4 * (channel - 1) + 1) & 1u;
}

static int64_t position(timer *t) {
    chip *c = t->bank.chip;
    if (t->follows == FOLLOWS_PYTHON) {
        return chip_position(c, t->number);
    }
    const int connected =
        c->world->converting && chip_route(c, t->signals[0]) && chip_route(c, t->signals[1]);
    return connected ? world_position(c->world, schedule_seconds(c), t->axis) : 0;
}

/* The encoder is looked at anew: what it did before does not count. */
void timer_place(timer *t) {
    t->placed = t->follows != FOLLOWS_NOTHING && encoder(t);
    if (t->placed) {
        t->last_position = position(t);
    }
}

/* Counts the edges that a moving encoder has produced since the last look. A position is in quarter periods,
 * so in the mode that counts every edge one step is one count. */
static void follow(timer *t) {
    if (t->follows == FOLLOWS_NOTHING) {
        return;
    }
    const int64_t here = position(t);
    if (t->placed && here != t->last_position) {
        if (mode(t) != ENCODER_BOTH) {
            chip_violate(t->bank.chip, t->bank.name, "17.3.12", "a position in an encoder mode other than 3");
            return;
        }
        timer_turn(t, inverted(t, 1) != inverted(t, 2) ? t->last_position - here : here - t->last_position);
    }
    t->last_position = here;
    t->placed = 1;
}

/* CNT now. */
uint64_t timer_count(timer *t) {
    if ((t->reg[CR1] & CEN) == 0) {
        return t->count;
    }
    if (encoder(t)) {
        follow(t);
    } else if (mode(t) == INTERNAL || mode(t) == TRIGGER) {
        return (t->count + (t->bank.chip->now - t->since) / step(t)) % ((uint64_t)t->arr + 1u);
    }
    return t->count;
}

/* Reading CCRx clears CCxIF (17.4.5). */
uint32_t timer_read_capture(timer *t, uint32_t channel) {
    t->reg[SR] &= ~(1u << channel);
    if ((t->reg[DIER] >> channel & 1u) != 0) {
        timer_update_line(t);
    }
    return t->reg[CCR1 + channel - 1];
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    timer *t = (timer *)b;
    if ((size != 4 && size != 2) || offset % 4 != 0) {
        return 0;
    }
    const uint32_t index = offset / 4;
    if (index == CNT) {
        *value = (uint32_t)timer_count(t);
    } else if (index == SR) {
        (void)timer_count(t);
        *value = t->reg[SR];
    } else if (index >= CCR1 && index < CCR1 + 4) {
        *value = timer_read_capture(t, index - CCR1 + 1);
    } else {
        return 0;
    }
    return 1;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    timer *t = (timer *)b;
    if ((size != 4 && size != 2) || offset != 4 * SR) {
        return 0;
    }
    t->reg[SR] &= value; /* flags are cleared by writing zeros */
    timer_update_line(t);
    return 1;
}

void timer_bind(timer *t) {
    t->bank.read = read;
    t->bank.write = write;
}
