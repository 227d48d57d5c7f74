/* The serial line: USART2 at 921600 baud, both directions by DMA.
 *
 * Reception fills a circular buffer; the line falling idle marks how far a burst goes and when it ended.
 * Transmission takes whole frames into a ring, from which DMA sends one contiguous stretch after another.
 */
#ifndef SERIAL_H
#define SERIAL_H

#include "impid_core.h"

void serial_start(void);
/* Main loop: hands what has arrived to the core. */
void serial_poll(impid_core_t *core);
/* Something has arrived that serial_poll() would hand over. */
bool serial_pending(void);
/* Main loop. false: no room for all of it, and nothing was taken. */
bool serial_send(const uint8_t *bytes, size_t count);
/* How long what is sent now waits. */
uint32_t serial_backlog_us(void);
/* Everything, to the last stop bit, has left. */
bool serial_done(void);
/* Adds the line's part to the account. */
void serial_health(impid_port_health_t *health);

#endif
