/* What the chip says of the reset behind it. */
#ifndef RESET_H
#define RESET_H

#include <stdint.h>

/* `csr`: RCC_CSR as it was found. Returns STATUS_HEALTH.reset_cause. */
uint8_t reset_cause_by(uint32_t csr);

#endif
