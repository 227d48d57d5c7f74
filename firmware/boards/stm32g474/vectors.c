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
            [0 ... 10] = unexpected_handler,
            [IRQ_DMA1_CHANNEL1] = tick_handler,
            [12 ... 14] = unexpected_handler,
            [IRQ_DMA1_CHANNEL5] = serial_sent_handler,
            [16 ... 17] = unexpected_handler,
            [IRQ_ADC1_2] = adc_handler,
            [19 ... 20] = unexpected_handler,
            [IRQ_FDCAN1_IT0] = fdcan1_it0_handler,
            [IRQ_FDCAN1_IT1] = fdcan1_it1_handler,
            [23 ... 37] = unexpected_handler,
            [IRQ_USART2] = usart2_handler,
            [39 ... 101] = unexpected_handler,
        },
};
