#include "serial.h"

#include "board.h"
#include "clock.h"
#include "interrupts.h"
#include "pin.h"
#include "serial_line.h"
#include "timebase.h"

#include <string.h>

#define AF_USART2      7u
#define BITS_PER_BYTE  10u
#define IDLE_AFTER_US  11u /* IDLE is set one byte's time after the last byte */
#define RECEIVE_BYTES  256u
#define TRANSMIT_BYTES 1024u /* powers of two */

static uint8_t received[RECEIVE_BYTES];
static uint32_t consumed; /* main loop alone: place of the next byte to hand over */
/* Written by the interrupt; the main loop reads them as a pair, masked. */
static volatile uint32_t burst_end;
static volatile uint32_t burst_us;

static volatile uint16_t damaged_bursts; /* interrupt */

static uint8_t transmit[TRANSMIT_BYTES];
/* Free-running: bytes ever queued (main loop) and ever sent (interrupt); the difference is in the ring. The
 * stretch between `sent` and `sent + under_way` belongs to DMA. */
static volatile uint32_t queued;
static volatile uint32_t sent;
static volatile uint32_t under_way;

void serial_start(void) {
    pin_alternate(BOARD_SERIAL_TX, AF_USART2, PIN_PULL_NONE);
    pin_alternate(BOARD_SERIAL_RX, AF_USART2, PIN_PULL_UP);

    line_start(received, RECEIVE_BYTES);
    interrupt_enable(IRQ_USART2, PRIORITY_STAMP);
}

/* --- Reception ----------------------------------------------------------------------------------- */

void usart2_handler(void) {
    uint32_t now_us = timebase_now_us();
    uint32_t status = line_take_status();
    if ((status & LINE_IDLE) != 0u) {
        burst_end = RECEIVE_BYTES - line_room();
        burst_us = now_us - IDLE_AFTER_US;
    }
    /* These flags stay from the byte that raised them to this read: one count a burst. */
    if ((status & LINE_ERRORS) != 0u) {
        damaged_bursts++;
    }
}

static void hand_over(impid_core_t *core, uint32_t mark, uint32_t t_us) {
    uint32_t end = mark % RECEIVE_BYTES;
    if (end < consumed) {
        impid_core_serial_receive(core, &received[consumed], RECEIVE_BYTES - consumed, t_us);
        consumed = 0u;
    }
    if (consumed < end) {
        impid_core_serial_receive(core, &received[consumed], end - consumed, t_us);
        consumed = end;
    }
}

void serial_poll(impid_core_t *core) {
    uint32_t before = interrupts_mask();
    uint32_t end = burst_end;
    uint32_t t_us = burst_us;
    interrupts_restore(before);
    if (end % RECEIVE_BYTES != consumed) {
        hand_over(core, end, t_us);
        return;
    }
    /* A sender that leaves no pause must not overwrite what waits: half a buffer is handed over as it is. */
    uint32_t place = RECEIVE_BYTES - line_room();
    if ((place - consumed) % RECEIVE_BYTES > RECEIVE_BYTES / 2u) {
        hand_over(core, place, timebase_now_us());
        before = interrupts_mask();
        if (burst_end == end) {
            burst_end = place; /* or the old mark would look like a burst that wraps */
        }
        interrupts_restore(before);
    }
}

bool serial_pending(void) {
    return burst_end % RECEIVE_BYTES != consumed;
}

/* --- Transmission -------------------------------------------------------------------------------- */

/* Interrupt, or main loop with interrupts masked, and only while nothing is under way. */
static void send_next_stretch(void) {
    uint32_t start = sent % TRANSMIT_BYTES;
    uint32_t count = queued - sent;
    if (count > TRANSMIT_BYTES - start) {
        count = TRANSMIT_BYTES - start;
    }
    under_way = count;
    if (count == 0u) {
        return;
    }
    line_send(&transmit[start], count);
}

void serial_sent_handler(void) {
    line_sent();
    sent += under_way;
    send_next_stretch();
}

bool serial_send(const uint8_t *bytes, size_t count) {
    uint32_t place = queued;
    /* `sent` only grows meanwhile: there may be more room than this, never less. */
    if (count > TRANSMIT_BYTES - (place - sent)) {
        return false;
    }
    uint32_t first = place % TRANSMIT_BYTES;
    size_t stretch = count < TRANSMIT_BYTES - first ? count : TRANSMIT_BYTES - first;
    memcpy(&transmit[first], bytes, stretch);
    memcpy(&transmit[0], &bytes[stretch], count - stretch);
    uint32_t before = interrupts_mask();
    queued = place + (uint32_t)count;
    if (under_way == 0u) {
        send_next_stretch();
    }
    interrupts_restore(before);
    return true;
}

uint32_t serial_backlog_us(void) {
    uint32_t before = interrupts_mask();
    uint32_t waiting = queued - sent;
    if (under_way > 0u) {
        waiting -= under_way - (line_left());
    }
    interrupts_restore(before);
    return waiting * BITS_PER_BYTE * LINE_DIVIDER / (CLOCK_APB1_HZ / 1000000u);
}

bool serial_done(void) {
    return queued == sent && line_done();
}

void serial_health(impid_port_health_t *health) {
    health->line_errors = damaged_bursts;
}
