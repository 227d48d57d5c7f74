#include "reset.h"

#include "impid_messages.h"
#include "registers.h"

uint8_t reset_cause_by(uint32_t csr) {
    if ((csr & (RCC_CSR_IWDGRSTF | RCC_CSR_WWDGRSTF)) != 0u) {
        return IMPID_MESSAGES_STATUS_HEALTH_RESET_CAUSE_WATCHDOG_CHOICE;
    }
    if ((csr & RCC_CSR_SFTRSTF) != 0u) {
        return IMPID_MESSAGES_STATUS_HEALTH_RESET_CAUSE_SOFTWARE_CHOICE;
    }
    /* Power-on and brown-out share a flag, and every reset sets the pin's: so in this order. */
    if ((csr & RCC_CSR_BORRSTF) != 0u) {
        return IMPID_MESSAGES_STATUS_HEALTH_RESET_CAUSE_POWER_ON_CHOICE;
    }
    if ((csr & RCC_CSR_PINRSTF) != 0u) {
        return IMPID_MESSAGES_STATUS_HEALTH_RESET_CAUSE_PIN_CHOICE;
    }
    return IMPID_MESSAGES_STATUS_HEALTH_RESET_CAUSE_UNKNOWN_CHOICE;
}
