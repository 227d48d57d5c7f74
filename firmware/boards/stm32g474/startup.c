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
            [0 ... 10] = unexpected_handler,
            [IRQ_DMA1_CHANNEL1] = dma1_channel1_handler,
            [12 ... 14] = unexpected_handler,
            [IRQ_DMA1_CHANNEL5] = dma1_channel5_handler,
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
