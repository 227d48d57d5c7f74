/* Who answers which interrupt. */
#include "vectors.h"

/* Whatever has no handler is not enabled either; should it come all the same, it is recorded. */
__attribute__((section(".vectors"), used)) const vector_table_t vectors = {
    .stack_top = linker_stack_top,
    .reset = reset_handler,
    .nmi = nmi_handler,
    .faults = {fault_handler, fault_handler, fault_handler, fault_handler},
    .system = {[0 ... 8] = unexpected_handler},
    .irq =
        {
            [0 ... 16] = unexpected_handler,
            [IRQ_DMA1_STREAM6] = serial_sent_handler,
            [IRQ_ADC] = adc_handler,
            [IRQ_CAN1_TX] = can1_tx_handler,
            [IRQ_CAN1_RX0] = can1_rx0_handler,
            [21] = unexpected_handler,
            [IRQ_CAN1_SCE] = can1_sce_handler,
            [23 ... 37] = unexpected_handler,
            [IRQ_USART2] = usart2_handler,
            [39 ... 55] = unexpected_handler,
            [IRQ_DMA2_STREAM0] = tick_handler,
            [57 ... 96] = unexpected_handler,
        },
};
