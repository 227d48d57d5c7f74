/* Who interrupts whom, and how long it may take. The four priority bits all preempt.
 *
 *   priority 0  stamps: USART2 idle, CAN receive. Their moment of entry is the measurement, they are short
 *               (below 3 us), and nothing else suffers from them, because
 *   priority 1  the tick needs no punctuality: its conversions, counts and time were latched by hardware,
 *               and stay readable for 1125 us.
 *   priority 2  transmit: serial and CAN queues, bus-off.
 *   main loop   everything else.
 *
 * Time budget of a 1000 us period at 90 MHz, the slower chip: tick 250 us at most (the worst run is in
 * STATUS_HEALTH), stamps 3 us each, transmit 5 us each. The main loop has the rest, and may stall 256 ms
 * before the ring is full.
 */
#ifndef INTERRUPTS_H
#define INTERRUPTS_H

#include "irq.h"
#include "registers.h"

enum { PRIORITY_STAMP = 0, PRIORITY_TICK = 1, PRIORITY_TRANSMIT = 2 };

static inline void interrupt_enable(uint32_t irq, uint32_t priority) {
    NVIC_IPR[irq] = (uint8_t)(priority << 4);
    NVIC_ISER[irq / 32u] = 1u << (irq % 32u);
}

/* A stretch that no interrupt may enter; they nest. Kept to a few instructions. */
static inline uint32_t interrupts_mask(void) {
    uint32_t before;
    __asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(before)::"memory");
    return before;
}

static inline void interrupts_restore(uint32_t before) {
    __asm volatile("msr primask, %0" ::"r"(before) : "memory");
}

extern uint32_t linker_stack_top[];
typedef void (*handler_t)(void);

/* The handlers that the vector table names, besides those of the chip's CAN. */
void reset_handler(void);
void nmi_handler(void);
void fault_handler(void);
void unexpected_handler(void);
void usart2_handler(void);      /* the line has fallen idle */
void serial_sent_handler(void); /* DMA has sent what it was given */
void tick_handler(void);        /* DMA has filled half of the conversions */
void adc_handler(void);

#endif
