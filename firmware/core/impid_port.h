/* What the core asks of a board: this handful of functions is all that a port supplies, and all that a
 * test has to imitate.
 *
 * Data flow: the port calls the core (impid_core_tick from the sampling interrupt, everything else from
 * the main loop); the core calls the port only from the main loop, through this struct. No function may
 * block: a carrier that has no room says so, and the core counts the frame as dropped.
 *
 * Ownership: `context` belongs to the port and is handed back unchanged. Bytes and frames passed to a
 * send function are the core's and must be copied before the function returns.
 */
#ifndef IMPID_PORT_H
#define IMPID_PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint16_t id; /* 11-bit identifier */
    uint8_t dlc; /* 0..8 */
    uint8_t data[8];
} impid_can_frame_t;

/* The carriers. Each has its own link counters, and the stream goes only where START came from. */
typedef enum { IMPID_CARRIER_SERIAL = 0, IMPID_CARRIER_CAN = 1, IMPID_CARRIERS = 2 } impid_carrier_t;

typedef struct {
    uint16_t bus_off;       /* times the controller left the bus since boot */
    uint8_t tx_errors;      /* the controller's transmit error counter */
    uint8_t rx_errors;      /* the controller's receive error counter */
    uint16_t supply_mV;     /* of the accelerometer, which is the converter's reference; 0: not measured */
    uint16_t worst_tick_us; /* longest run of the sampling interrupt since boot */
    uint32_t sync_us;       /* the counter at the last edge on the sync input */
    uint32_t sync_count;    /* samples flagged with an edge since boot */
    uint32_t rejected;      /* commands that arrived and found no room in the port, since boot */
    uint16_t line_errors;   /* bursts on the serial line with a framing, noise or overrun error, since boot */
    uint16_t can_overruns;  /* times the controller lost a command before it could be fetched, since boot */
    uint16_t adc_overruns;  /* resets because conversions were not fetched, since power-on */
    uint16_t dma_errors;    /* resets because a transfer failed, since power-on */
} impid_port_health_t;

typedef struct {
    void *context;
    /* The free-running microsecond counter; wraps at 2^32. The same one stamps the ticks. */
    uint32_t (*now_us)(void *context);
    /* All of the bytes or none; false: no room. */
    bool (*serial_send)(void *context, const uint8_t *bytes, size_t count);
    /* false: no free place in the transmit queue. */
    bool (*can_send)(void *context, const impid_can_frame_t *frame);
    /* How long what is sent now waits behind what was sent before, in microseconds. */
    uint32_t (*backlog_us)(void *context, impid_carrier_t carrier);
    void (*self_test_pin)(void *context, bool drive);
    impid_port_health_t (*health)(void *context);
    /* Restart the board once everything sent has left it. */
    void (*request_reset)(void *context);
} impid_port_t;

#endif
