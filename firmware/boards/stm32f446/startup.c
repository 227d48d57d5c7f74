/* From reset to main(), and the table of who answers which interrupt. */
#include "interrupts.h"

#include <string.h>

int main(void);

extern uint8_t linker_data_start[];
extern uint8_t linker_data_end[];
extern const uint8_t linker_data_image[];
extern uint8_t linker_bss_start[];
extern uint8_t linker_bss_end[];

typedef struct {
    uint32_t *stack_top;
    handler_t reset;
    handler_t nmi;
    handler_t faults[4]; /* hard, memory, bus, usage */
    handler_t system[9]; /* 7 to 15: none used */
    handler_t irq[IRQ_COUNT];
} vector_table_t;

/* Whatever has no handler is not enabled either; should it come all the same, it is recorded. */

__attribute__((section(".vectors"), used)) static const vector_table_t vectors = {
    .stack_top = linker_stack_top,
    .reset = reset_handler,
    .nmi = nmi_handler,
    .faults = {fault_handler, fault_handler, fault_handler, fault_handler},
    .system = {[0 ... 8] = unexpected_handler},
    .irq =
        {
            [0 ... 16] = unexpected_handler,
            [IRQ_DMA1_STREAM6] = dma1_stream6_handler,
            [IRQ_ADC] = adc_handler,
            [IRQ_CAN1_TX] = can1_tx_handler,
            [IRQ_CAN1_RX0] = can1_rx0_handler,
            [21] = unexpected_handler,
            [IRQ_CAN1_SCE] = can1_sce_handler,
            [23 ... 37] = unexpected_handler,
            [IRQ_USART2] = usart2_handler,
            [39 ... 55] = unexpected_handler,
            [IRQ_DMA2_STREAM0] = dma2_stream0_handler,
            [57 ... 96] = unexpected_handler,
        },
};

/* The linker's symbols mark places in one memory, which C cannot know: hence numbers, not pointers. */
static size_t bytes_between(const uint8_t *start, const uint8_t *end) {
    return (uintptr_t)end - (uintptr_t)start;
}

void reset_handler(void) {
    SCB->VTOR = (uint32_t)(uintptr_t)&vectors;
    (void)memcpy(linker_data_start, linker_data_image, bytes_between(linker_data_start, linker_data_end));
    (void)memset(linker_bss_start, 0, bytes_between(linker_bss_start, linker_bss_end));
    (void)main();
    unexpected_handler();
}
