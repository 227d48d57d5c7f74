/* USART2 and its two streams, as serial.c uses them. */
#ifndef SERIAL_LINE_H
#define SERIAL_LINE_H

#include "clock.h"
#include "interrupts.h"
#include "registers.h"

#include <stdbool.h>

#define BAUD           921600u
#define LINE_DIVIDER   ((CLOCK_APB1_HZ + BAUD / 2u) / BAUD) /* 49: 918367 baud, -0.35 % */
#define CHANNEL_USART2 4u
#define LINE_IDLE      USART_SR_IDLE
#define LINE_ERRORS    USART_SR_ERRORS

/* What arrives goes round in a buffer. */
static inline void line_start(uint8_t *received, uint32_t bytes) {
    clock_enable(&RCC->AHB1ENR, RCC_AHB1ENR_DMA1);
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_USART2);

    dma_stream_regs_t *reception = &DMA1->S[5];
    reception->PAR = (uint32_t)(uintptr_t)&USART2->DR;
    reception->M0AR = (uint32_t)(uintptr_t)received;
    reception->NDTR = bytes;
    reception->FCR = 0u;
    reception->CR = DMA_CR_CHANNEL(CHANNEL_USART2) | DMA_CR_MINC | DMA_CR_CIRC;
    reception->CR |= DMA_CR_EN;

    dma_stream_regs_t *transmission = &DMA1->S[6];
    transmission->PAR = (uint32_t)(uintptr_t)&USART2->DR;
    transmission->FCR = 0u;

    USART2->BRR = LINE_DIVIDER;
    USART2->CR3 = USART_CR3_DMAR | USART_CR3_DMAT;
    USART2->CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_IDLEIE;
    interrupt_enable(IRQ_DMA1_STREAM6, PRIORITY_TRANSMIT);
}

/* Bytes from where the next one will be put to the end of the buffer. */
static inline uint32_t line_room(void) {
    return DMA1->S[5].NDTR;
}

/* The flags, taken away. */
static inline uint32_t line_take_status(void) {
    uint32_t status = USART2->SR;
    (void)USART2->DR; /* SR, then DR, clears IDLE; the line is idle, so no byte is taken from DMA */
    return status;
}

static inline void line_send(const uint8_t *bytes, uint32_t count) {
    dma_stream_regs_t *stream = &DMA1->S[6];
    DMA1->HIFCR = DMA_STREAM6_FLAGS;
    USART2->SR = ~USART_SR_TC; /* cleared by writing 0, the others are left alone by writing 1 */
    stream->M0AR = (uint32_t)(uintptr_t)bytes;
    stream->NDTR = count;
    stream->CR = DMA_CR_CHANNEL(CHANNEL_USART2) | DMA_CR_MINC | DMA_CR_FROM_MEMORY | DMA_CR_TCIE;
    stream->CR |= DMA_CR_EN;
}

/* In the interrupt that says so. */
static inline void line_sent(void) {
    DMA1->HIFCR = DMA_STREAM6_FLAGS;
}

/* Bytes that DMA has not fetched yet. */
static inline uint32_t line_left(void) {
    return DMA1->S[6].NDTR & UINT16_MAX;
}

/* The last stop bit has left. */
static inline bool line_done(void) {
    return (USART2->SR & USART_SR_TC) != 0u;
}

#endif
