/* Transfers of the DMA controllers (chapter 9). A request moves one item at the instant it is made; what may
 * be written when is dma.py's. */
#include "chip.h"

#include <string.h>

enum { CR, NDTR, PAR, M0AR, M1AR, FCR };
enum {
    EN = 1,
    TEIE = 1 << 2,
    HTIE = 1 << 3,
    TCIE = 1 << 4,
    FROM_MEMORY = 1 << 6,
    CIRC = 1 << 8,
    MINC = 1 << 10
};
enum { DBM = 1 << 18, CT = 1 << 19 };
enum { TEIF = 1 << 3, HTIF = 1 << 4, TCIF = 1 << 5 };

static const uint32_t SHIFT[4] = {0, 6, 16, 22}; /* of streams 0 to 3 in LISR, 4 to 7 in HISR (9.5.1) */

typedef struct {
    int controller, stream;
    uint32_t channel;
} mapping;
/* 9.3.3, tables of DMA1 and DMA2; in the order of the requests in chip.h. */
static const mapping REQUEST[REQUESTS] = {
    {DMA_1, 1, 3}, {DMA_1, 0, 6}, {DMA_1, 5, 4}, {DMA_1, 6, 4}, {DMA_2, 0, 0},
};

/* The enables are one bit below their flags. */
void dma_update_line(dma *d, uint32_t stream) {
    dma_stream *s = &d->streams[stream];
    const uint32_t wanted = s->reg[CR] << 1 & (TEIF | HTIF | TCIF);
    nvic_set_line(d->bank.chip, s->irq, (s->flags & wanted) != 0);
}

void dma_set_flags(dma *d, uint32_t stream, uint32_t flags) {
    d->streams[stream].flags |= flags;
    dma_update_line(d, stream);
}

static void advance(dma *d, uint32_t stream) {
    dma_stream *s = &d->streams[stream];
    const uint32_t left = --s->reg[NDTR];
    s->block_ended = left == 0;
    if (left == s->total / 2) {
        dma_set_flags(d, stream, HTIF);
    }
    if (left == 0) {
        if ((s->reg[CR] & DBM) != 0) {
            s->reg[CR] ^= CT; /* double-buffer mode is circular (9.3.10) */
        }
        if ((s->reg[CR] & (CIRC | DBM)) != 0) {
            s->reg[NDTR] = s->total;
        } else {
            s->reg[CR] &= ~(uint32_t)EN;
        }
        dma_set_flags(d, stream, TCIF);
    }
}

static uint8_t *place(const chip *c, uint32_t address, uint32_t size, int writing) {
    if (address >= c->ram_base && address - c->ram_base <= c->ram_size - size) {
        return c->ram + (address - c->ram_base);
    }
    if (!writing && address >= c->flash_base && address - c->flash_base <= c->flash_size - size) {
        return c->flash + (address - c->flash_base);
    }
    return NULL;
}

static void transfer(dma *d, uint32_t stream) {
    dma_stream *s = &d->streams[stream];
    chip *c = d->bank.chip;
    const uint32_t cr = s->reg[CR];
    uint32_t address = (cr & (DBM | CT)) == (DBM | CT) ? s->reg[M1AR] : s->reg[M0AR];
    if ((cr & MINC) != 0) {
        address += (s->total - s->reg[NDTR]) * s->size;
    }
    const int writing = (cr & FROM_MEMORY) == 0;
    uint8_t *memory = s->failing ? NULL : place(c, address, s->size, writing);
    bank *b = s->peripheral;
    uint32_t value = 0;
    if (memory == NULL) {
        s->reg[CR] &= ~(uint32_t)EN; /* a bus error stops the stream (9.3.18) */
        dma_set_flags(d, stream, TEIF);
        return;
    }
    if (writing) {
        if (b == NULL || !b->read(b, s->offset, s->size, &value)) {
            value = chip_read(c, s->reg[PAR], s->size);
        }
        memcpy(memory, &value, s->size);
    } else {
        memcpy(&value, memory, s->size);
        if (b == NULL || !b->write(b, s->offset, s->size, value)) {
            chip_write(c, s->reg[PAR], s->size, value);
        }
    }
    advance(d, stream);
}

/* Moves one item if the stream is enabled and listens to the channel. Returns whether it was. */
int dma_request(chip *c, int source) {
    const mapping *m = &REQUEST[source];
    dma *d = c->dmas[m->controller];
    const uint32_t cr = d->streams[m->stream].reg[CR];
    if ((cr & EN) == 0 || (cr >> 25 & 7u) != m->channel) {
        return 0;
    }
    transfer(d, (uint32_t)m->stream);
    return 1;
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    const dma *d = (const dma *)b;
    if (size != 4) {
        return 0;
    }
    if (offset < 8) {
        *value = 0;
        for (uint32_t n = 0; n < 4; ++n) {
            *value |= d->streams[offset + n].flags << SHIFT[n];
        }
        return 1;
    }
    if (offset < 0x10 || offset >= 0x10 + 8 * 0x18 || (offset - 0x10) % 0x18 / 4 == FCR) {
        return 0;
    }
    *value = d->streams[(offset - 0x10) / 0x18].reg[(offset - 0x10) % 0x18 / 4];
    return 1;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    dma *d = (dma *)b;
    if (size != 4 || (offset != 8 && offset != 12) || (value & ~0x0F7D0F7Du) != 0) {
        return 0;
    }
    for (uint32_t n = 0; n < 4; ++n) {
        const uint32_t stream = offset - 8 + n;
        d->streams[stream].flags &= ~(value >> SHIFT[n] & 0x3Du);
        dma_update_line(d, stream);
    }
    return 1;
}

void dma_bind(dma *d) {
    d->bank.read = read;
    d->bank.write = write;
}
