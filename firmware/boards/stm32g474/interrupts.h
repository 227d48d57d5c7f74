/* Who interrupts whom, and how long it may take: as on the other board (boards/stm32f446/interrupts.h).
 *
 *   priority 0  stamps: USART2 idle, FDCAN receive
 *   priority 1  the tick
 *   priority 2  transmit: serial and CAN queues, bus-off
 */
#ifndef INTERRUPTS_H
#define INTERRUPTS_H

#include "registers.h"

/* Positions in the vector table: RM0440, nested vectored interrupt controller. */
enum {
    IRQ_DMA1_CHANNEL1 = 11,
    IRQ_DMA1_CHANNEL5 = 15,
    IRQ_ADC1_2 = 18,
    IRQ_FDCAN1_IT0 = 21,
    IRQ_FDCAN1_IT1 = 22,
    IRQ_USART2 = 38,
    IRQ_COUNT = 102
};

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

/* What a vector table begins with, and what it is made of. */
extern uint32_t linker_stack_top[];
typedef void (*handler_t)(void);

/* The handlers that the vector table names. */
void reset_handler(void);
void nmi_handler(void);
void fault_handler(void);
void unexpected_handler(void);
void usart2_handler(void);
void fdcan1_it0_handler(void);
void fdcan1_it1_handler(void);
void dma1_channel1_handler(void);
void dma1_channel5_handler(void);
void adc_handler(void);

#endif
