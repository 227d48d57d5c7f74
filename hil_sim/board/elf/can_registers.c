/* Mailboxes, FIFOs, flags and error counters of the CAN controller as the processor reads and writes them
 * (30.9). */
#include "can_bits.h"

#include <stdio.h>
#include <string.h>

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
            can_release(n, box, 1u);
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
