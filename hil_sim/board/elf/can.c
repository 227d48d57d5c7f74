/* The CAN controller and the bus it sits on (chapter 30): frames pass whole; modes and configuration are
 * can.py's.
 *
 * A frame takes as long as the most stuff bits allow. Whether it is acknowledged, or damaged so that error
 * counters move as ISO 11898-1 says, is decided by the bus that a test sets up.
 */
#include "chip.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MCR = 0, MSR = 1, TSR = 2, RF0R = 3, IER = 5, ESR = 6, BTR = 7 };
enum { FMR = 0x200 / 4, FM1R = 0x204 / 4, FS1R = 0x20C / 4, FFA1R = 0x214 / 4, FA1R = 0x21C / 4 };
enum { TXFP = 1 << 2, RFLM = 1 << 3, NART = 1 << 4, ABOM = 1 << 6 };
enum { LBKM = 1 << 30 };
enum { INAK = 1, SLAK = 2, ERRI = 1 << 2 };
enum { TMEIE = 1, FMPIE0 = 1 << 1, FFIE0 = 1 << 2, FOVIE0 = 1 << 3 };
enum { EWGIE = 1 << 8, EPVIE = 1 << 9, BOFIE = 1 << 10, LECIE = 1 << 11, ERRIE = 1 << 15 };
enum { EWGF = 1, EPVF = 2, BOFF = 4, TXRQ = 1, RTR = 2, IDE = 4 };
enum { LEC_ACK = 3, LEC_BIT_RECESSIVE = 4, WARNING = 96, PASSIVE = 128, BUS_OFF = 256 };
enum { MAILBOXES = 3, FIFO_DEPTH = 3, BANKS = 28, IRQ_TX = 19, IRQ_SCE = 22 };
enum { TRANSMIT_AT = 0x180, RECEIVE_AT = 0x1B0, FILTERS_AT = 0x240 };

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

static void release(can *n, uint32_t box, uint32_t status) {
    n->words[box][0] &= ~(uint32_t)TXRQ;
    n->reg[TSR] = (n->reg[TSR] & ~(0xFFu << 8 * box)) | status << 8 * box;
}

static void failed(can *n, uint32_t box, uint32_t lec, int32_t penalty) {
    n->tec += penalty;
    if ((n->reg[MCR] & NART) != 0) {
        release(n, box, 0x9u); /* RQCP, TERR */
    }
    can_counters_changed(n, lec);
}

static void transmitted(can *n, uint32_t box) {
    if (loops(n)) {
        const can_frame frame = frame_in(n, box);
        if (!silent(n)) {
            push(&n->sent, frame);
        }
        release(n, box, 0x3u); /* RQCP, TXOK: an acknowledge is not looked for (30.5.2) */
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
        release(n, box, 0x3u); /* RQCP, TXOK */
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

/* --- registers ----------------------------------------------------------------------------------- */

/* TME by mailbox, CODE of the next free one, LOW flags not modelled (read as 0). */
uint32_t can_read_tsr(const can *n) {
    uint32_t value = n->reg[TSR] & 0x000F0F0Fu;
    int32_t free_box = -1;
    uint32_t last = 0;
    for (uint32_t box = 0; box < MAILBOXES; ++box) {
        if ((n->words[box][0] & TXRQ) == 0) {
            value |= 1u << (26 + box);
            free_box = free_box < 0 ? (int32_t)box : free_box;
        }
        last = n->words[box][0] >> 21 >= n->words[last][0] >> 21 ? box : last;
    }
    return value | (free_box >= 0 ? (uint32_t)free_box : last) << 24;
}

/* Writing a one to RQCP clears the mailbox's result flags; ABRQ takes a waiting frame back. */
void can_write_tsr(can *n, uint32_t value) {
    for (uint32_t box = 0; box < MAILBOXES; ++box) {
        const uint32_t bits = value >> 8 * box;
        if ((bits & 1u) != 0) {
            n->reg[TSR] &= ~(0x0Fu << 8 * box);
        }
        if ((bits & 0x80u) != 0 && (n->words[box][0] & TXRQ) != 0 && n->sending != (int32_t)box) {
            release(n, box, 1u);
        }
    }
    can_update_lines(n);
}

/* FMP, FULL, FOVR. */
uint32_t can_read_fifo(const can *n, uint32_t fifo) {
    return n->fifo_count[fifo] | (n->reg[RF0R + fifo] & 0x18u);
}

/* RFOM gives the oldest frame back; ones clear FULL and FOVR. */
void can_write_fifo(can *n, uint32_t fifo, uint32_t value) {
    n->reg[RF0R + fifo] &= ~(value & 0x18u);
    if ((value & 0x20u) != 0 && n->fifo_count[fifo] > 0) {
        --n->fifo_count[fifo];
        memmove(&n->fifos[fifo][0], &n->fifos[fifo][1], 2 * sizeof(can_frame));
        n->reg[RF0R + fifo] &= ~0x08u;
    }
    can_update_lines(n);
}

uint32_t can_read_esr(const can *n) {
    const uint32_t tec = (uint32_t)(n->tec < 255 ? n->tec : 255);
    const uint32_t rec = (uint32_t)(n->rec < 255 ? n->rec : 255);
    return n->reg[ESR] | tec << 16 | rec << 24;
}

static uint32_t receive_word(can *n, uint32_t offset) {
    const uint32_t fifo = (offset - RECEIVE_AT) / 16;
    const can_frame *frame = &n->fifos[fifo][0];
    uint32_t words[4] = {frame->identifier << 21, frame->length, 0, 0};
    if (n->fifo_count[fifo] == 0) {
        chip_violate(n->bank.chip, n->bank.name, "30.9.3", "a receive FIFO read while empty");
    }
    memcpy(&words[2], frame->data, 8);
    return words[(offset - RECEIVE_AT) % 16 / 4];
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    can *n = (can *)b;
    if (size != 4) {
        return 0;
    }
    if (offset == 4 * TSR) {
        *value = can_read_tsr(n);
    } else if (offset == 4 * RF0R || offset == 4 * RF0R + 4) {
        *value = can_read_fifo(n, offset / 4 - RF0R);
    } else if (offset == 4 * ESR) {
        *value = can_read_esr(n);
    } else if (offset >= TRANSMIT_AT && offset < RECEIVE_AT) {
        *value = n->words[(offset - TRANSMIT_AT) / 16][offset % 16 / 4];
    } else if (offset >= RECEIVE_AT && offset < RECEIVE_AT + 32) {
        *value = receive_word(n, offset);
    } else if (offset >= FILTERS_AT && offset < FILTERS_AT + 8 * BANKS) {
        *value = n->filters[(offset - FILTERS_AT) / 8][offset % 8 / 4];
    } else {
        return 0;
    }
    return 1;
}

static int write_mailbox(can *n, uint32_t box, uint32_t word, uint32_t value) {
    if ((word == 0 && (value & (IDE | RTR)) != 0) || (word == 1 && (value & ~0xFu) != 0)) {
        return 0; /* not modelled: Python says so */
    }
    if ((n->words[box][0] & TXRQ) != 0) {
        char text[64];
        (void)snprintf(text, sizeof text, "transmit mailbox %u written while it waits to send", box);
        chip_violate(n->bank.chip, n->bank.name, "30.7.1", text);
        return 1;
    }
    n->words[box][word] = value;
    if (word == 0 && (value & TXRQ) != 0) {
        n->order[box] = ++n->requests;
        n->reg[TSR] &= ~(0x0Fu << 8 * box); /* a new request clears RQCP */
        can_arbitrate(n);
        can_update_lines(n);
    }
    return 1;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    can *n = (can *)b;
    if (size != 4) {
        return 0;
    }
    if (offset == 4 * TSR) {
        can_write_tsr(n, value);
    } else if ((offset == 4 * RF0R || offset == 4 * RF0R + 4) && (value & ~0x3Fu) == 0) {
        can_write_fifo(n, offset / 4 - RF0R, value);
    } else if (offset >= TRANSMIT_AT && offset < RECEIVE_AT) {
        return write_mailbox(n, (offset - TRANSMIT_AT) / 16, offset % 16 / 4, value);
    } else {
        return 0;
    }
    return 1;
}

void can_bind(can *n) {
    n->bank.read = read;
    n->bank.write = write;
}
