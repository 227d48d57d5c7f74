/* What the processor starts with, and who answers which interrupt: vectors.c of each chip. */
#ifndef VECTORS_H
#define VECTORS_H

#include "interrupts.h"

typedef struct {
    uint32_t *stack_top;
    handler_t reset;
    handler_t nmi;
    handler_t faults[4]; /* hard, memory, bus, usage */
    handler_t system[9]; /* 7 to 15: none used */
    handler_t irq[IRQ_COUNT];
} vector_table_t;
extern const vector_table_t vectors;

#endif
