/* What ended the last run: kept in memory that start-up does not clear, so that it outlives the reset.
 *
 * A fault handler writes the record and resets; the next boot finds it, reports FAULT as the reset cause,
 * and keeps it readable (LOG) until power is lost. A power-on leaves random bits there, which the checksum
 * tells from a record.
 */
#ifndef FAULT_H
#define FAULT_H

#include "impid_port.h"
#include "impid_trace.h"

#include <stdint.h>

typedef enum {
    FAULT_NONE = 0,
    FAULT_PROCESSOR = 1,  /* hard, memory, bus or usage fault: see CFSR, HFSR */
    FAULT_CLOCK_LOST = 2, /* the external clock stopped */
    FAULT_ADC_OVERRUN = 3,
    FAULT_DMA = 4,                  /* a stream reported a transfer error, which stops it */
    FAULT_UNEXPECTED_INTERRUPT = 5, /* `address` holds the vector's number */
    FAULT_ASSERTION = 6,            /* `pc`: just behind where the core found what cannot be */
} fault_kind_t;

/* The words that LOG returns, in this order. */
typedef struct {
    uint32_t count; /* faults since power-on */
    uint32_t kind;  /* fault_kind_t of the last one */
    uint32_t pc, lr, psr;
    uint32_t cfsr, hfsr;
    uint32_t address; /* MMFAR or BFAR if valid */
    uint32_t uptime_us;
    uint32_t last_boot_id;  /* the boot before this one and the samples of its last stream, */
    uint32_t last_produced; /* both zero after a loss of power */
} fault_log_t;

#define FAULT_LOG_WORDS (sizeof(fault_log_t) / sizeof(uint32_t))

/* At boot, once: the reset cause as STATUS_HEALTH.reset_cause, and the log made valid. */
uint8_t fault_reset_cause(void);
/* Kept as the log is; to be given to the core after fault_reset_cause(), which has read it. */
impid_trace_t *fault_trace(void);
const fault_log_t *fault_log(void);
/* Adds the counts that outlive a reset to the account. */
void fault_health(impid_port_health_t *health);

/* Records and resets; do not return. */
_Noreturn void fault_stop(fault_kind_t kind);
_Noreturn void fault_reset(void);

#endif
