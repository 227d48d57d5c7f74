#include "fault.h"

#include "impid_assert.h"
#include "impid_crc32.h"
#include "impid_messages.h"
#include "interrupts.h"
#include "registers.h"
#include "reset.h"
#include "timebase.h"

#include <stdbool.h>
#include <string.h>

/* What the processor pushes on entry (Armv7-M architecture, B1.5.6). */
typedef struct {
    uint32_t r0, r1, r2, r3, r12, lr, pc, psr;
} stacked_t;

extern uint8_t linker_ram_start[];
extern uint8_t linker_ram_end[];

static struct {
    fault_log_t log;
    uint32_t adc_overruns; /* since power-on, as log.count */
    uint32_t dma_errors;
    uint32_t fresh; /* 1: written by the run that has just ended */
    uint32_t crc;
} kept __attribute__((section(".noinit")));

static impid_trace_t trace __attribute__((section(".noinit")));

static uint32_t kept_crc(void) {
    return impid_crc32((const uint8_t *)&kept, offsetof(__typeof__(kept), crc));
}

static void seal(uint32_t fresh) {
    kept.fresh = fresh;
    kept.crc = kept_crc();
}

uint8_t fault_reset_cause(void) {
    uint8_t cause = reset_cause_by(RCC->CSR);
    RCC->CSR |= RCC_CSR_RMVF;
    if (kept.crc != kept_crc()) {
        (void)memset(&kept, 0, sizeof kept);
    } else if (kept.fresh == 1u) {
        cause = IMPID_MESSAGES_STATUS_HEALTH_RESET_CAUSE_FAULT_CHOICE;
    } else {
        /* an older record: only kept */
    }
    (void)impid_trace_read(&trace, &kept.log.last_boot_id, &kept.log.last_produced);
    seal(0u);
    return cause;
}

impid_trace_t *fault_trace(void) {
    return &trace;
}

const fault_log_t *fault_log(void) {
    return &kept.log;
}

void fault_health(impid_port_health_t *health) {
    health->adc_overruns = (uint16_t)kept.adc_overruns;
    health->dma_errors = (uint16_t)kept.dma_errors;
}

_Noreturn void fault_reset(void) {
    __asm volatile("dsb" ::: "memory");
    SCB->AIRCR = SCB_AIRCR_RESET;
    for (;;) {
    }
}

static _Noreturn void record_and_reset(fault_kind_t kind, const stacked_t *at, uint32_t address) {
    uint32_t count = kept.log.count + 1u;
    kept.log = (fault_log_t){.count = count,
                             .kind = (uint32_t)kind,
                             .cfsr = SCB->CFSR,
                             .hfsr = SCB->HFSR,
                             .address = address,
                             .uptime_us = timebase_as_it_stands()};
    if (at != NULL) {
        kept.log.pc = at->pc;
        kept.log.lr = at->lr;
        kept.log.psr = at->psr;
    }
    kept.adc_overruns += kind == FAULT_ADC_OVERRUN ? 1u : 0u;
    kept.dma_errors += kind == FAULT_DMA ? 1u : 0u;
    seal(1u);
    fault_reset();
}

_Noreturn void fault_stop(fault_kind_t kind) {
    record_and_reset(kind, NULL, 0u);
}

_Noreturn void impid_assert_failed(const char *what) {
    (void)what;
    const stacked_t at = {.pc = (uint32_t)(uintptr_t)__builtin_return_address(0)};
    record_and_reset(FAULT_ASSERTION, &at, 0u);
}

void unexpected_handler(void) {
    record_and_reset(FAULT_UNEXPECTED_INTERRUPT, NULL, SCB->ICSR & SCB_ICSR_VECTACTIVE);
}

/* Called by fault_handler() on a stack of its own. */
__attribute__((used)) static _Noreturn void fault_record(const stacked_t *at) {
    uint32_t place = (uint32_t)(uintptr_t)at;
    /* After an overflow the stack pointer points below the RAM: nothing was pushed that could be read. */
    bool readable = place >= (uint32_t)(uintptr_t)linker_ram_start &&
                    place <= (uint32_t)(uintptr_t)linker_ram_end - sizeof *at;
    uint32_t cfsr = SCB->CFSR;
    uint32_t address = 0u;
    if ((cfsr & SCB_CFSR_BFARVALID) != 0u) {
        address = SCB->BFAR;
    } else if ((cfsr & SCB_CFSR_MMARVALID) != 0u) {
        address = SCB->MMFAR;
    } else {
        /* no address belongs to this fault */
    }
    record_and_reset(FAULT_PROCESSOR, readable ? at : NULL, address);
}

/* A stack of its own: the fault may be that the other one is full. */
__attribute__((used, aligned(8))) static uint8_t fault_stack[256];

__attribute__((naked)) void fault_handler(void) {
    __asm volatile("mrs r0, msp\n\t"
                   "ldr r1, =fault_stack + 256\n\t"
                   "mov sp, r1\n\t"
                   "b fault_record\n");
}
