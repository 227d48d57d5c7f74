/* A port for tests: a clock that the test sets, and a record of what the core sent and asked. */
#ifndef FAKE_PORT_H
#define FAKE_PORT_H

#include "impid_core.h"

#define FAKE_FRAMES 512u

typedef struct {
    impid_port_t port;
    uint32_t now_us;
    uint32_t backlog_us;
    bool refuse;             /* the carriers have no room */
    uint32_t can_room_after; /* CAN has none for so many frames */
    bool pin;
    bool reset_requested;
    uint32_t rejected; /* commands that the port had no room for */
    uint16_t supply_mV;
    /* Serial frames as the parser reads them back. */
    impid_frame_parser_t parser;
    struct impid_messages_batch_t headers[FAKE_FRAMES];
    uint8_t records[FAKE_FRAMES][IMPID_FRAME_RECORDS_MAX];
    uint32_t frames;
    impid_can_frame_t can[FAKE_FRAMES];
    uint32_t can_frames;
} fake_port_t;

void fake_port_init(fake_port_t *fake);
/* The latest serial frame; fails the test where there is none of this kind. */
const uint8_t *fake_last_record(const fake_port_t *fake, uint8_t kind);
uint32_t fake_count(const fake_port_t *fake, uint8_t kind);
void fake_send_command(impid_core_t *core, impid_carrier_t carrier, uint16_t request_id, uint8_t opcode,
                       uint8_t item, uint32_t value, uint32_t t_us);
/* The answer to the last command on the serial line. */
struct impid_messages_response_t fake_response(const fake_port_t *fake);
/* One period with constant input: tick, clock, main loop. */
void fake_period(impid_core_t *core, fake_port_t *fake, uint16_t x, uint16_t y, uint8_t flags);

#endif
