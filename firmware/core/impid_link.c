#include "impid_link.h"

#include "impid_assert.h"

#include <string.h>

static bool counted(impid_link_t *link, bool taken) {
    if (taken) {
        link->frames_sent++;
    } else {
        link->frames_dropped++;
    }
    return taken;
}

bool impid_link_send_serial(impid_link_t *link, const impid_port_t *port,
                            struct impid_messages_batch_t header, const uint8_t *records) {
    uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
    header.version = IMPID_PROTOCOL_VERSION;
    header.frame_seq = link->frame_seq++;
    size_t length = impid_frame_encode(&header, records, encoded);
    IMPID_ASSERT(length <= sizeof encoded && encoded[length - 1u] == 0u);
    return counted(link, port->serial_send(port->context, encoded, length));
}

bool impid_link_send_can(impid_link_t *link, const impid_port_t *port, uint16_t id, const uint8_t *payload) {
    impid_can_frame_t frame = {.id = id, .dlc = 8u};
    memcpy(frame.data, payload, sizeof frame.data);
    return counted(link, port->can_send(port->context, &frame));
}
