/* Bytes of the serial port (chapter 25): 8 data bits, 1 stop bit, both directions; configuration is
 * usart.py's. */
#include "chip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SR, DR, BRR, CR1, CR2, CR3 };
enum { FE = 1 << 1, NF = 1 << 2, ORE = 1 << 3, IDLE = 1 << 4, RXNE = 1 << 5, TC = 1 << 6, TXE = 1 << 7 };
enum {
    RE = 1 << 2,
    TE = 1 << 3,
    IDLEIE = 1 << 4,
    RXNEIE = 1 << 5,
    TCIE = 1 << 6,
    TXEIE = 1 << 7,
    UE = 1 << 13
};
enum { EIE = 1, DMAR = 1 << 6, DMAT = 1 << 7 };
enum { FRAME_BITS = 10 };
/* The receiver samples the middle of the tenth bit: the other side may be this far off (25.4.5). */
static const double TOLERANCE = 0.0375;

static void violate(usart *u, const char *section, const char *rule) {
    chip_violate(u->bank.chip, u->bank.name, section, rule);
}

/* Processor cycles a byte. */
static uint64_t frame_cycles(usart *u) {
    if (u->reg[BRR] < 16) {
        violate(u, "25.4.4", "BRR is below 16");
        return FRAME_BITS;
    }
    return (uint64_t)FRAME_BITS * u->reg[BRR] * u->bank.chip->apb1;
}

static int on(const usart *u, uint32_t direction) {
    return (u->reg[CR1] & (UE | direction)) == (UE | direction);
}

/* Each flag with its enable; ORE comes with RXNEIE, or with EIE under DMA (25.5). */
void usart_update_line(usart *u) {
    const uint32_t sr = u->reg[SR];
    const uint32_t cr1 = u->reg[CR1];
    const int high = ((sr & IDLE) != 0 && (cr1 & IDLEIE) != 0) ||
                     ((sr & (RXNE | ORE)) != 0 && (cr1 & RXNEIE) != 0) ||
                     ((sr & TC) != 0 && (cr1 & TCIE) != 0) || ((sr & TXE) != 0 && (cr1 & TXEIE) != 0) ||
                     ((sr & ORE) != 0 && (u->reg[CR3] & (EIE | DMAR)) == (EIE | DMAR));
    nvic_set_line(u->bank.chip, u->irq, high);
}

static void append(uint8_t **bytes, size_t *count, size_t *room, const uint8_t *data, size_t more) {
    if (*count + more > *room) {
        *room = 2 * (*count + more) + 256;
        *bytes = realloc(*bytes, *room);
        if (*bytes == NULL) {
            abort();
        }
    }
    memcpy(*bytes + *count, data, more);
    *count += more;
}

void usart_free(usart *u) {
    free(u->incoming);
    free(u->sent);
}

/* --- transmitter (25.4.2) ------------------------------------------------------------------------ */

static void shifted(chip *c, void *owner, uint64_t byte);

/* Moves DR into the shift register; TXE comes with it. */
static void load(usart *u) {
    const uint8_t byte = (uint8_t)u->holding;
    u->holding = -1;
    u->reg[SR] |= TXE;
    u->shifting = 1;
    (void)schedule_at(u->bank.chip, u->bank.chip->now + frame_cycles(u), shifted, u, byte);
}

static void shifted(chip *c, void *owner, uint64_t byte) {
    usart *u = owner;
    const uint8_t sent = (uint8_t)byte;
    (void)c;
    append(&u->sent, &u->sent_count, &u->sent_room, &sent, 1);
    u->shifting = 0;
    if (u->holding >= 0) {
        load(u);
        usart_feed(u);
    } else {
        u->reg[SR] |= TC;
    }
    usart_update_line(u);
}

/* TXE with DMAT requests the next byte; again after each until DR stays full. */
void usart_feed(usart *u) {
    while ((u->reg[CR3] & DMAT) != 0 && (u->reg[SR] & TXE) != 0 && on(u, TE) && !u->bank.chip->failed) {
        if (!dma_request(u->bank.chip, REQUEST_USART2_TX)) {
            return;
        }
    }
}

void usart_write_dr(usart *u, uint32_t value) {
    if (!on(u, TE)) {
        violate(u, "25.4.2", "DR written while the transmitter is off");
    } else if (!chip_route(u->bank.chip, u->tx_signal)) {
        violate(u, "7.3.2", "DR written while no pin is switched to TX");
    } else if (u->holding >= 0) {
        violate(u, "25.4.2", "DR overwritten before it was sent");
    } else {
        u->holding = (int32_t)(value & 0xFFu);
        u->reg[SR] &= ~(uint32_t)(TXE | (u->status_read ? TC : 0)); /* SR, then DR, clears TC (25.6.1) */
        u->status_read = 0;
        if (!u->shifting) {
            load(u);
        }
        usart_update_line(u);
    }
}

/* --- receiver (25.4.3) --------------------------------------------------------------------------- */

/* A frame of idle line after a reception. */
static void idles(chip *c, void *owner, uint64_t detail) {
    usart *u = owner;
    (void)c;
    (void)detail;
    u->idle = NULL;
    u->reg[SR] |= IDLE;
    usart_update_line(u);
}

void usart_offer(usart *u) {
    if ((u->reg[CR3] & DMAR) != 0 && (u->reg[SR] & RXNE) != 0) {
        (void)dma_request(u->bank.chip, REQUEST_USART2_RX);
    }
}

static int too_different(usart *u) {
    const double baud = u->bank.chip->frequency / ((double)frame_cycles(u) / FRAME_BITS);
    if (fabs(baud / u->line_rate - 1.0) <= TOLERANCE) {
        return 0;
    }
    char text[64];
    (void)snprintf(text, sizeof text, "%.0f baud cannot receive %.0f baud", baud, u->line_rate);
    violate(u, "25.4.5", text);
    return 1;
}

static void arrives(chip *c, void *owner, uint64_t detail) {
    usart *u = owner;
    (void)detail;
    uint8_t byte = u->incoming[u->incoming_first++];
    u->arrival = NULL;
    if (u->incoming_first < u->incoming_count) {
        u->arrival = schedule_after_seconds(c, FRAME_BITS / u->line_rate, arrives, u, 0);
    } else {
        u->incoming_first = u->incoming_count = 0;
    }
    if (!on(u, RE) || !chip_route(c, u->rx_signal) || too_different(u)) {
        return;
    }
    if (u->damaged > 0) {
        --u->damaged;
        u->reg[SR] |= FE | NF;
        byte ^= 0x40u;
    }
    if ((u->reg[SR] & RXNE) != 0) {
        u->reg[SR] |= ORE; /* the byte is lost, DR keeps the old one */
    } else {
        u->received = byte;
        u->reg[SR] |= RXNE;
        usart_offer(u);
    }
    if (u->idle != NULL) {
        schedule_cancel(u->idle);
    }
    u->idle = schedule_at(c, c->now + frame_cycles(u), idles, u, 0);
    usart_update_line(u);
}

/* The other side sends bytes back to back, from now or after what it sends already. */
void usart_receive(usart *u, const uint8_t *data, size_t count, double baud) {
    append(&u->incoming, &u->incoming_count, &u->incoming_room, data, count);
    u->line_rate = baud;
    if (u->arrival == NULL && u->incoming_first < u->incoming_count) {
        u->arrival = schedule_after_seconds(u->bank.chip, FRAME_BITS / baud, arrives, u, 0);
    }
}

/* --- registers ----------------------------------------------------------------------------------- */

/* First half of the sequences that clear IDLE, the errors and TC. */
uint32_t usart_read_sr(usart *u) {
    u->status_read = 1;
    return u->reg[SR];
}

/* Takes the received byte; after a read of SR also clears IDLE and the errors. */
uint32_t usart_read_dr(usart *u) {
    u->reg[SR] &= ~(uint32_t)(RXNE | (u->status_read ? IDLE | ORE | NF | FE : 0));
    u->status_read = 0;
    usart_update_line(u);
    return u->received;
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    usart *u = (usart *)b;
    (void)size;
    if (offset == 4 * SR) {
        *value = usart_read_sr(u);
    } else if (offset == 4 * DR) {
        *value = usart_read_dr(u);
    } else {
        return 0;
    }
    return 1;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    usart *u = (usart *)b;
    (void)size;
    if (offset != 4 * DR || value > 0x1FFu) {
        return 0;
    }
    usart_write_dr(u, value);
    return 1;
}

void usart_bind(usart *u) {
    u->bank.read = read;
    u->bank.write = write;
}
