#include "impid_status.h"

uint16_t impid_status_message_id(uint32_t n, uint32_t *at) {
    /* STATUS_BUS closed the set before STATUS_LOSSES was there, and readers of that time wait for it. */
    static const uint16_t ids[IMPID_STATUS_MESSAGES] = {
        IMPID_MESSAGES_STATUS_SAMPLES_FRAME_ID,  IMPID_MESSAGES_STATUS_LINK_FRAME_ID,
        IMPID_MESSAGES_STATUS_TIMING_FRAME_ID,   IMPID_MESSAGES_STATUS_SENSORS_FRAME_ID,
        IMPID_MESSAGES_STATUS_COMMANDS_FRAME_ID, IMPID_MESSAGES_STATUS_HEALTH_FRAME_ID,
        IMPID_MESSAGES_STATUS_LOSSES_FRAME_ID,   IMPID_MESSAGES_STATUS_BUS_FRAME_ID,
    };
    *at = 8u * (uint32_t)(ids[n] - IMPID_MESSAGES_STATUS_SAMPLES_FRAME_ID);
    return ids[n];
}

void impid_status_pack(const impid_status_t *status, uint8_t out[IMPID_STATUS_LENGTH]) {
    (void)impid_messages_status_samples_pack(&out[0], &status->samples, 8u);
    (void)impid_messages_status_link_pack(&out[8], &status->link, 8u);
    (void)impid_messages_status_timing_pack(&out[16], &status->timing, 8u);
    (void)impid_messages_status_sensors_pack(&out[24], &status->sensors, 8u);
    (void)impid_messages_status_commands_pack(&out[32], &status->commands, 8u);
    (void)impid_messages_status_health_pack(&out[40], &status->health, 8u);
    (void)impid_messages_status_bus_pack(&out[48], &status->bus, 8u);
    (void)impid_messages_status_losses_pack(&out[56], &status->losses, 8u);
}
