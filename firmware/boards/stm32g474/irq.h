/* Who interrupts on this chip. */
#ifndef IRQ_H
#define IRQ_H

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

void fdcan1_it0_handler(void);
void fdcan1_it1_handler(void);

#endif
