/* USART2 and its two channels, as serial.c uses them. */
#ifndef SERIAL_LINE_H
#define SERIAL_LINE_H

#include "clock.h"
#include "interrupts.h"
#include "registers.h"

#include <stdbool.h>

#define BAUD         921600u
#define LINE_DIVIDER ((CLOCK_APB1_HZ + BAUD / 2u) / BAUD) /* 156: 923077 baud, 0.16 % */
#define REQUEST_RX   26u
#define REQUEST_TX   27u
#define RECEPTION    3u /* channels 4 and 5, counted from 0 */
#define TRANSMISSION 4u
#define LINE_IDLE    USART_ISR_IDLE
#define LINE_ERRORS  USART_ISR_ERRORS

/* What arrives goes round in a buffer. */
static inline void line_start(uint8_t *received, uint32_t bytes) {
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX1);
    clock_enable(&RCC->APB1ENR1, RCC_APB1ENR1_USART2);

    DMAMUX1->CCR[RECEPTION] = REQUEST_RX;
    dma_channel_regs_t *reception = &DMA1->CH[RECEPTION];
    reception->PAR = (uint32_t)(uintptr_t)&USART2->RDR;
    reception->MAR = (uint32_t)(uintptr_t)received;
    reception->NDTR = bytes;
    reception->CR = DMA_CR_MINC | DMA_CR_CIRC;
    reception->CR |= DMA_CR_EN;

    DMAMUX1->CCR[TRANSMISSION] = REQUEST_TX;
    DMA1->CH[TRANSMISSION].PAR = (uint32_t)(uintptr_t)&USART2->TDR;

    USART2->BRR = LINE_DIVIDER;
    USART2->CR3 = USART_CR3_DMAR | USART_CR3_DMAT;
    USART2->CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_IDLEIE;
    interrupt_enable(IRQ_DMA1_CHANNEL5, PRIORITY_TRANSMIT);
}

/* Bytes from where the next one will be put to the end of the buffer. */
static inline uint32_t line_room(void) {
    return DMA1->CH[RECEPTION].NDTR;
}

/* The flags, taken away. */
static inline uint32_t line_take_status(void) {
    uint32_t status = USART2->ISR;
    USART2->ICR = USART_ICR_IDLE | USART_ISR_ERRORS; /* by writing 1 */
    return status;
}

static inline void line_send(const uint8_t *bytes, uint32_t count) {
    dma_channel_regs_t *channel = &DMA1->CH[TRANSMISSION];
    channel->CR = 0u; /* address and count can be written only while it is off */
    DMA1->IFCR = DMA_IFCR_ALL(TRANSMISSION);
    USART2->ICR = USART_ICR_TC;
    channel->MAR = (uint32_t)(uintptr_t)bytes;
    channel->NDTR = count;
    channel->CR = DMA_CR_MINC | DMA_CR_FROM_MEMORY | DMA_CR_TCIE;
    channel->CR |= DMA_CR_EN;
}

/* In the interrupt that says so. */
static inline void line_sent(void) {
    DMA1->IFCR = DMA_IFCR_ALL(TRANSMISSION);
}

/* Bytes that DMA has not fetched yet. */
static inline uint32_t line_left(void) {
    return DMA1->CH[TRANSMISSION].NDTR & UINT16_MAX;
}

/* The last stop bit has left. */
static inline bool line_done(void) {
    return (USART2->ISR & USART_ISR_TC) != 0u;
}

#endif
