/* Who interrupts on this chip. */
#ifndef IRQ_H
#define IRQ_H

/* Positions in the vector table: RM0390, 10.1.3. */
enum {
    IRQ_DMA1_STREAM6 = 17,
    IRQ_ADC = 18,
    IRQ_CAN1_TX = 19,
    IRQ_CAN1_RX0 = 20,
    IRQ_CAN1_SCE = 22,
    IRQ_USART2 = 38,
    IRQ_DMA2_STREAM0 = 56,
    IRQ_COUNT = 97
};

void can1_rx0_handler(void);
void can1_tx_handler(void);
void can1_sce_handler(void);

#endif
