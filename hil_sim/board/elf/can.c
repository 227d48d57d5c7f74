/* The CAN controller and the bus it sits on (chapter 30): frames pass whole; what the processor sees of it is
 * in can_registers.c, modes and configuration are can.py's.
 *
 * A frame takes as long as the most stuff bits allow. Whether it is acknowledged, or damaged so that error
 * counters move as ISO 11898-1 says, is decided by the bus that a test sets up.
 */
#include "can_bits.h"

#include <stdlib.h>
#include <string.h>

/* --- queues of frames ---------------------------------------------------------------------------- */

static void push(can_queue *q, can_frame frame) {
    if (q->first + q->count == q->room) {
        memmove(q->frames, q->frames + q->first, q->count * sizeof *q->frames);
        q->first = 0;
        if (2 * q->count >= q->room) {
            q->room = 2 * q->room + 64;
            q->frames = realloc(q->frames, q->room * sizeof *q->frames);
            if (q->frames == NULL) {
                abort();
            }
        }
    }
    q->frames[q->first + q->count++] = frame;
}

static can_frame pop(can_queue *q) {
    --q->count;
    return q->frames[q->first++];
}

void can_free(can *n) {
    free(n->waiting.frames);
    free(n->sent.frames);
}

/* Processor cycles a bit: (BRP + 1) * (1 + TS1 + 1 + TS2 + 1) bus clock cycles (30.7.7). */
uint64_t can_bit_cycles(const can *n) {
    const uint32_t btr = n->reg[BTR];
    const uint64_t quanta = 3u + (btr >> 16 & 15u) + (btr >> 20 & 7u);
    return ((btr & 0x3FFu) + 1u) * quanta * n->bank.chip->apb1;
}

/* Longest standard data frame: 44 bits and the data, 3 of interframe space, and a stuff bit after each four
 * of the 34 + 8 n bits that can be stuffed (after the first five). */
uint64_t can_frame_bits(uint32_t length) {
    return 44u + 8u * length + (34u + 8u * length - 1u) / 4u + 3u;
}

static can_frame frame_in(const can *n, uint32_t box) {
    const uint32_t *words = n->words[box];
    const uint32_t length = words[1] & 15u;
    can_frame frame = {.identifier = words[0] >> 21, .length = length < 8 ? length : 8};
    memcpy(frame.data, &words[2], 8);
    return frame;
}

void can_update_lines(can *n) {
    chip *c = n->bank.chip;
    const uint32_t ier = n->reg[IER];
    nvic_set_line(c, IRQ_TX, (ier & TMEIE) != 0 && (n->reg[TSR] & 0x00010101u) != 0);
    for (uint32_t fifo = 0; fifo < 2; ++fifo) {
        const uint32_t enables = ier >> 3 * fifo;
        const uint32_t flags = n->reg[RF0R + fifo];
        nvic_set_line(c, IRQ_TX + 1 + fifo,
                      (n->fifo_count[fifo] > 0 && (enables & FMPIE0) != 0) ||
                          ((flags & 8u) != 0 && (enables & FFIE0) != 0) ||
                          ((flags & 16u) != 0 && (enables & FOVIE0) != 0));
    }
    nvic_set_line(c, IRQ_SCE, (ier & ERRIE) != 0 && (n->reg[MSR] & ERRI) != 0);
}

/* --- fault confinement (30.7.6) ------------------------------------------------------------------ */

/* 128 times eleven recessive bits have passed: error active again. */
void can_recovered(can *n) {
    n->recovering = NULL;
    n->bus_off = 0;
    n->tec = n->rec = 0;
    can_counters_changed(n, 0);
    can_arbitrate(n);
}

static void recovers(chip *c, void *owner, uint64_t detail) {
    (void)c;
    (void)detail;
    can_recovered(owner);
}

void can_counters_changed(can *n, uint32_t lec) {
    chip *c = n->bank.chip;
    const uint32_t before = n->reg[ESR] & 7u;
    uint32_t flags = (n->tec >= WARNING || n->rec >= WARNING ? EWGF : 0u) |
                     (n->tec >= PASSIVE || n->rec >= PASSIVE ? EPVF : 0u);
    if (n->tec >= BUS_OFF) {
        n->bus_off = 1;
        flags |= BOFF;
        if ((n->reg[MCR] & ABOM) != 0 && n->recovering == NULL) {
            n->recovering = schedule_at(c, c->now + CAN_RECOVERY_BITS * can_bit_cycles(n), recovers, n, 0);
        }
    }
    n->reg[ESR] = flags | lec << 4;
    const uint32_t news = flags & ~before;
    const uint32_t ier = n->reg[IER];
    if (((news & EWGF) != 0 && (ier & EWGIE) != 0) || ((news & EPVF) != 0 && (ier & EPVIE) != 0) ||
        ((news & BOFF) != 0 && (ier & BOFIE) != 0) || (lec != 0 && (ier & LECIE) != 0)) {
        n->reg[MSR] |= ERRI;
    }
    can_update_lines(n);
}

/* Test modes (30.5): with LBKM the controller hears itself alone, with SILM too nobody hears it. */
static int loops(const can *n) {
    return (n->reg[BTR] & LBKM) != 0;
}

static int silent(const can *n) {
    return n->reg[BTR] >> 31 != 0;
}

static void accept(can *n, can_frame frame);

/* --- transmission (30.7.1) ----------------------------------------------------------------------- */

/* The pending mailbox that goes first: by order of request with TXFP, else by identifier. */
static int32_t next_mailbox(const can *n) {
    int32_t best = -1;
    uint64_t best_key = UINT64_MAX;
    for (uint32_t box = 0; box < MAILBOXES; ++box) {
        const uint64_t key = (n->reg[MCR] & TXFP) != 0 ? n->order[box] : n->words[box][0] >> 21;
        if ((n->words[box][0] & TXRQ) != 0 && key < best_key) {
            best = (int32_t)box;
            best_key = key;
        }
    }
    return best;
}

void can_release(can *n, uint32_t box, uint32_t status) {
    n->words[box][0] &= ~(uint32_t)TXRQ;
    n->reg[TSR] = (n->reg[TSR] & ~(0xFFu << 8 * box)) | status << 8 * box;
}

static void failed(can *n, uint32_t box, uint32_t lec, int32_t penalty) {
    n->tec += penalty;
    if ((n->reg[MCR] & NART) != 0) {
        can_release(n, box, 0x9u); /* RQCP, TERR */
    }
    can_counters_changed(n, lec);
}

static void transmitted(can *n, uint32_t box) {
    if (loops(n)) {
        const can_frame frame = frame_in(n, box);
        if (!silent(n)) {
            push(&n->sent, frame);
        }
        can_release(n, box, 0x3u); /* RQCP, TXOK: an acknowledge is not looked for (30.5.2) */
        can_counters_changed(n, 0);
        accept(n, frame);
    } else if (!chip_route(n->bank.chip, n->tx_signal)) {
        chip_violate(n->bank.chip, n->bank.name, "7.3.2", "transmission while no pin is switched to TX");
    } else if (n->damaged_transmissions > 0) {
        --n->damaged_transmissions;
        failed(n, box, LEC_BIT_RECESSIVE, 8);
    } else if (!n->acknowledged) {
        /* A node that is alone goes to error passive and no further (ISO 11898-1 fault confinement). */
        failed(n, box, LEC_ACK, n->tec < PASSIVE ? 8 : 0);
    } else {
        push(&n->sent, frame_in(n, box));
        n->tec = n->tec > 0 ? n->tec - 1 : 0;
        can_release(n, box, 0x3u); /* RQCP, TXOK */
        can_counters_changed(n, 0);
    }
}

/* --- reception and filters (30.7.3, 30.7.4) ------------------------------------------------------ */

/* FIFO of the first active bank that lets the frame pass, -1: none; 32-bit scale only. */
static int32_t filter(can *n, uint32_t identifier) {
    const uint32_t word = identifier << 21;
    if ((n->reg[FMR] & 1u) != 0) {
        return -1; /* no reception while the filters are being set up (30.9.4) */
    }
    for (uint32_t number = 0; number < BANKS; ++number) {
        if ((n->reg[FA1R] >> number & 1u) == 0) {
            continue;
        }
        if ((n->reg[FS1R] >> number & 1u) == 0) {
            chip_violate(n->bank.chip, n->bank.name, "30.7.4",
                         "a filter of 16 bits, which the emulator does not model");
            return -1;
        }
        const uint32_t first = n->filters[number][0];
        const uint32_t second = n->filters[number][1];
        const int listed = (n->reg[FM1R] >> number & 1u) != 0;
        if (listed ? word == first || word == second : ((word ^ first) & second & ~1u) == 0) {
            return (int32_t)(n->reg[FFA1R] >> number & 1u);
        }
    }
    return -1;
}

static void accept(can *n, can_frame frame) {
    n->rec = n->rec >= PASSIVE ? PASSIVE - 1 : n->rec > 0 ? n->rec - 1 : 0;
    if (!loops(n) && !chip_route(n->bank.chip, n->rx_signal)) {
        return;
    }
    const int32_t fifo = filter(n, frame.identifier);
    if (fifo < 0) {
        return;
    }
    if (n->fifo_count[fifo] == FIFO_DEPTH) {
        n->reg[RF0R + fifo] |= 1u << 4; /* FOVR */
        if ((n->reg[MCR] & RFLM) == 0) {
            n->fifos[fifo][FIFO_DEPTH - 1] = frame;
        }
    } else {
        n->fifos[fifo][n->fifo_count[fifo]++] = frame;
        if (n->fifo_count[fifo] == FIFO_DEPTH) {
            n->reg[RF0R + fifo] |= 1u << 3; /* FULL */
        }
    }
}

/* --- the bus ------------------------------------------------------------------------------------- */

static void frame_ends(chip *c, void *owner, uint64_t detail) {
    can *n = owner;
    (void)c;
    (void)detail;
    n->bus_event = NULL;
    if (n->sending >= 0) {
        transmitted(n, (uint32_t)n->sending);
        n->sending = -1;
    } else if (n->waiting.count > 0) {
        const can_frame frame = pop(&n->waiting);
        if (!loops(n)) { /* else the input is not looked at (30.5.2) */
            accept(n, frame);
        }
    }
    can_arbitrate(n);
    can_update_lines(n);
}

/* The bus is free: the lowest identifier of what anybody wants to send wins it. */
void can_arbitrate(can *n) {
    chip *c = n->bank.chip;
    if ((n->reg[MSR] & (INAK | SLAK)) != 0 || n->bus_off || n->bus_event != NULL || c->failed) {
        return;
    }
    const int32_t box = next_mailbox(n);
    const can_frame *other = n->waiting.count > 0 ? &n->waiting.frames[n->waiting.first] : NULL;
    uint32_t length = 0;
    if (box >= 0 && (other == NULL || n->words[box][0] >> 21 < other->identifier)) {
        n->sending = box;
        length = frame_in(n, (uint32_t)box).length;
    } else if (other != NULL) {
        n->sending = -1;
        length = other->length;
    } else {
        return;
    }
    n->bus_event = schedule_at(c, c->now + can_frame_bits(length) * can_bit_cycles(n), frame_ends, n, 0);
}

/* Another node wants to send a frame. */
void can_receive(can *n, uint32_t identifier, const uint8_t *data, uint32_t length) {
    can_frame frame = {.identifier = identifier, .length = length};
    memcpy(frame.data, data, length);
    push(&n->waiting, frame);
    can_arbitrate(n);
}
