#include "impid_command.h"

#include "impid_output.h"

/* Settings and log words have items of their own in the message set, so that an item means one thing. */
#define FIRST_SETTING  IMPID_MESSAGES_COMMAND_ITEM_BOOT_COUNT_CHOICE
#define FIRST_LOG_WORD IMPID_MESSAGES_COMMAND_ITEM_FAULT_COUNT_CHOICE

typedef struct {
    uint8_t result;
    uint32_t value;
} answer_t;

static answer_t ok(uint32_t value) {
    return (answer_t){IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE, value};
}

static answer_t refused(uint8_t result) {
    return (answer_t){result, 0u};
}

static answer_t info(const impid_core_t *core, uint8_t item) {
    const impid_core_config_t *config = &core->config;
    switch (item) {
    case IMPID_MESSAGES_COMMAND_ITEM_PROTOCOL_VERSION_CHOICE:
        return ok(IMPID_PROTOCOL_VERSION);
    case IMPID_MESSAGES_COMMAND_ITEM_FIRMWARE_VERSION_CHOICE:
        return ok(IMPID_FIRMWARE_VERSION);
    case IMPID_MESSAGES_COMMAND_ITEM_UID_0_CHOICE:
        return ok(config->uid[0]);
    case IMPID_MESSAGES_COMMAND_ITEM_UID_1_CHOICE:
        return ok(config->uid[1]);
    case IMPID_MESSAGES_COMMAND_ITEM_UID_2_CHOICE:
        return ok(config->uid[2]);
    case IMPID_MESSAGES_COMMAND_ITEM_BOOT_ID_CHOICE:
        return ok(config->boot_id);
    case IMPID_MESSAGES_COMMAND_ITEM_SAMPLE_RATE_HZ_CHOICE:
        return ok(IMPID_SAMPLE_RATE_HZ);
    case IMPID_MESSAGES_COMMAND_ITEM_GROUP_DELAY_US_CHOICE:
        return ok(config->sensor->group_delay_us);
    case IMPID_MESSAGES_COMMAND_ITEM_FULL_SCALE_CODE_CHOICE:
        return ok(config->sensor->wide ? 1u << 24 : 1u << 16);
    case IMPID_MESSAGES_COMMAND_ITEM_VREF_MV_CHOICE:
        return ok(config->sensor->full_scale_m != 0u ? config->sensor->full_scale_m
                                                     : core->port->health(core->port->context).supply_mV);
    case IMPID_MESSAGES_COMMAND_ITEM_BATCH_SAMPLES_CHOICE:
        return ok(IMPID_BATCH_SAMPLES);
    case IMPID_MESSAGES_COMMAND_ITEM_OVERSAMPLING_CHOICE:
        return ok(config->sensor->readings);
    case IMPID_MESSAGES_COMMAND_ITEM_RESET_CAUSE_CHOICE:
        return ok(config->reset_cause);
    case IMPID_MESSAGES_COMMAND_ITEM_CLOCK_SOURCE_CHOICE:
        return ok(config->clock_source);
    case IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_X_MV_CHOICE:
        return ok((uint32_t)core->selftest.response_m[0]);
    case IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_Y_MV_CHOICE:
        return ok((uint32_t)core->selftest.response_m[1]);
    case IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_Z_MV_CHOICE:
        return config->sensor->axes > 2u ? ok((uint32_t)core->selftest.response_m[IMPID_AXES_MAX - 1u])
                                         : refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE);
    case IMPID_MESSAGES_COMMAND_ITEM_SENSOR_CHOICE:
        return ok(config->sensor->id);
    case IMPID_MESSAGES_COMMAND_ITEM_AXES_CHOICE:
        return ok(config->sensor->axes);
    case IMPID_MESSAGES_COMMAND_ITEM_READING_BITS_CHOICE:
        return ok(config->sensor->reading_bits);
    case IMPID_MESSAGES_COMMAND_ITEM_SYNC_US_CHOICE:
        return ok(core->port->health(core->port->context).sync_us);
    case IMPID_MESSAGES_COMMAND_ITEM_SYNC_COUNT_CHOICE:
        return ok(core->port->health(core->port->context).sync_count);
    case IMPID_MESSAGES_COMMAND_ITEM_BUILD_COMMIT_CHOICE:
        return ok(config->build_commit);
    case IMPID_MESSAGES_COMMAND_ITEM_BUILD_STATE_CHOICE:
        return ok(config->build_state);
    case IMPID_MESSAGES_COMMAND_ITEM_BOARD_ID_CHOICE:
        return ok(config->board_id);
    case IMPID_MESSAGES_COMMAND_ITEM_UPDATE_SLOT_CHOICE:
        return ok(config->slots != NULL ? impid_update_slot(&core->update) : IMPID_SLOT_NONE);
    case IMPID_MESSAGES_COMMAND_ITEM_UPDATE_PENDING_CHOICE:
        return ok(config->slots != NULL && !impid_update_confirmed(&core->update) ? 1u : 0u);
    case IMPID_MESSAGES_COMMAND_ITEM_EXTERNAL_CLOCK_HZ_CHOICE:
        return ok(config->external_clock_hz);
    default:
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE);
    }
}

static answer_t update_answer(impid_update_result_t result, uint32_t value) {
    static const uint8_t codes[4] = {[IMPID_UPDATE_OK] = IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE,
                                     [IMPID_UPDATE_BAD_VALUE] =
                                         IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE,
                                     [IMPID_UPDATE_BAD_ITEM] = IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE,
                                     [IMPID_UPDATE_FAILED] = IMPID_MESSAGES_RESPONSE_RESULT_FAILED_CHOICE};
    return (answer_t){codes[result], value};
}

static bool busy(const impid_core_t *core) {
    return impid_stream_active(&core->stream) || impid_selftest_running(&core->selftest);
}

static answer_t update(impid_core_t *core, const struct impid_messages_command_t *command) {
    impid_update_t *update = &core->update;
    if (update->port == NULL) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_UNKNOWN_OPCODE_CHOICE);
    }
    if (busy(core)) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE);
    }
    switch (command->opcode) {
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_BEGIN_CHOICE:
        return update_answer(impid_update_begin(update, command->value), impid_update_slot(update));
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_WRITE_CHOICE: {
        impid_update_result_t result = impid_update_write(update, command->item, command->value);
        return update_answer(result, update->next);
    }
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_END_CHOICE:
        return update_answer(impid_update_finish(update, command->value), impid_update_slot(update));
    default:
        return update_answer(impid_update_confirm(update), 0u);
    }
}

static answer_t start(impid_core_t *core, impid_carrier_t carrier, uint32_t value) {
    if (value != 0u) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE);
    }
    if (impid_selftest_running(&core->selftest)) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE);
    }
    if (!impid_stream_active(&core->stream)) {
        impid_stream_begin(&core->stream, core->config.first_index);
        impid_sampler_start(&core->sampler, core->config.first_index);
    }
    impid_stream_join(&core->stream, carrier);
    return ok(core->stream.next_index);
}

static answer_t stop(impid_core_t *core, impid_carrier_t carrier) {
    bool was_active = impid_stream_active(&core->stream);
    bool last = was_active &&
                !core->stream.on[carrier == IMPID_CARRIER_SERIAL ? IMPID_CARRIER_CAN : IMPID_CARRIER_SERIAL];
    if (last) {
        impid_sampler_stop(&core->sampler);
    }
    if (was_active) {
        /* What was sampled before the command arrives before its answer. */
        impid_output_drain(core);
        impid_stream_leave(&core->stream, carrier, core->links, core->port);
    }
    return ok(core->sampler.produced);
}

static answer_t self_test(impid_core_t *core) {
    if (busy(core)) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE);
    }
    impid_selftest_begin(&core->selftest, core->port->health(core->port->context).supply_mV);
    impid_sampler_start(&core->sampler, core->config.first_index);
    return ok(0u);
}

static answer_t get(const impid_settings_t *settings, uint8_t item) {
    uint32_t value = 0;
    return impid_settings_get(settings, (uint32_t)item - FIRST_SETTING, &value)
               ? ok(value)
               : refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE);
}

static answer_t set(impid_settings_t *settings, uint8_t item, uint32_t value) {
    uint32_t setting = (uint32_t)item - FIRST_SETTING;
    uint32_t before;
    if (!impid_settings_get(settings, setting, &before)) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE);
    }
    return impid_settings_set(settings, setting, value)
               ? ok(value)
               : refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE);
}

static answer_t save(impid_settings_t *settings) {
    return impid_settings_save(settings) ? ok(0u) : refused(IMPID_MESSAGES_RESPONSE_RESULT_FAILED_CHOICE);
}

static answer_t keep(impid_settings_t *settings, const struct impid_messages_command_t *command) {
    if (settings == NULL) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_UNKNOWN_OPCODE_CHOICE);
    }
    switch (command->opcode) {
    case IMPID_MESSAGES_COMMAND_OPCODE_GET_CHOICE:
        return get(settings, command->item);
    case IMPID_MESSAGES_COMMAND_OPCODE_SET_CHOICE:
        return set(settings, command->item, command->value);
    default:
        return save(settings);
    }
}

static answer_t log_word(const impid_core_config_t *config, uint8_t item) {
    if (config->log == NULL) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_UNKNOWN_OPCODE_CHOICE);
    }
    uint32_t word = (uint32_t)item - FIRST_LOG_WORD;
    return word < config->log_words ? ok(config->log[word])
                                    : refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE);
}

static answer_t bench(impid_core_t *core, impid_carrier_t carrier,
                      const struct impid_messages_command_t *command) {
    /* The loopback takes the controller off the bus: the answer would not get out. */
    bool cuts_itself_off = carrier == IMPID_CARRIER_CAN &&
                           command->item == IMPID_MESSAGES_COMMAND_ITEM_BENCH_CAN_LOOPBACK_CHOICE;
    if (busy(core) || cuts_itself_off) {
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE);
    }
    uint32_t value;
    return impid_bench_execute(&core->bench, command->item, command->value, &value)
               ? ok(value)
               : refused(IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE);
}

static answer_t act(impid_core_t *core, impid_carrier_t carrier,
                    const struct impid_messages_command_t *command) {
    switch (command->opcode) {
    case IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE:
        return info(core, command->item);
    case IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE:
        return start(core, carrier, command->value);
    case IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE:
        return stop(core, carrier);
    case IMPID_MESSAGES_COMMAND_OPCODE_SELF_TEST_CHOICE:
        return self_test(core);
    case IMPID_MESSAGES_COMMAND_OPCODE_GET_CHOICE:
    case IMPID_MESSAGES_COMMAND_OPCODE_SET_CHOICE:
    case IMPID_MESSAGES_COMMAND_OPCODE_SAVE_CHOICE:
        return keep(core->config.settings, command);
    case IMPID_MESSAGES_COMMAND_OPCODE_LOG_CHOICE:
        return log_word(&core->config, command->item);
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_BEGIN_CHOICE:
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_WRITE_CHOICE:
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_END_CHOICE:
    case IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_CONFIRM_CHOICE:
        return update(core, command);
    case IMPID_MESSAGES_COMMAND_OPCODE_BENCH_CHOICE:
        return bench(core, carrier, command);
    case IMPID_MESSAGES_COMMAND_OPCODE_STATUS_CHOICE:
    case IMPID_MESSAGES_COMMAND_OPCODE_RESET_CHOICE:
        return ok(0u); /* acted on once the answer is out */
    default:
        return refused(IMPID_MESSAGES_RESPONSE_RESULT_UNKNOWN_OPCODE_CHOICE);
    }
}

static void respond(impid_core_t *core, impid_carrier_t carrier,
                    const struct impid_messages_response_t *response) {
    uint8_t record[IMPID_MESSAGES_RESPONSE_LENGTH];
    (void)impid_messages_response_pack(record, response, sizeof record);
    impid_output_record(core, carrier, IMPID_MESSAGES_BATCH_KIND_RESPONSE_CHOICE, record);
}

static void pong(impid_core_t *core, impid_carrier_t carrier, uint16_t request_id, uint32_t t_us) {
    const impid_port_t *port = core->port;
    /* The answer leaves after what is already under way on the carrier: that wait belongs to the hold,
     * not to the line, or half of it would appear as an error of the clock. */
    uint32_t hold = port->now_us(port->context) - t_us + port->backlog_us(port->context, carrier);
    struct impid_messages_pong_t answer = {
        .request_id = request_id, .hold_us = hold < UINT16_MAX ? (uint16_t)hold : UINT16_MAX, .t2_us = t_us};
    uint8_t record[IMPID_MESSAGES_PONG_LENGTH];
    (void)impid_messages_pong_pack(record, &answer, sizeof record);
    impid_output_record(core, carrier, IMPID_MESSAGES_BATCH_KIND_PONG_CHOICE, record);
}

void impid_command_execute(impid_core_t *core, impid_carrier_t carrier,
                           const struct impid_messages_command_t *command, uint32_t t_us) {
    if (command->opcode == IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE) {
        core->accepted++;
        pong(core, carrier, command->request_id, t_us);
        return;
    }
    uint64_t now_us = impid_output_now_us(core);
    const struct impid_messages_response_t *earlier =
        impid_replies_find(&core->replies, carrier, command, now_us);
    if (earlier != NULL) {
        respond(core, carrier, earlier);
        return;
    }
    answer_t answer = act(core, carrier, command);
    struct impid_messages_response_t response = {.request_id = command->request_id,
                                                 .opcode = command->opcode,
                                                 .result = answer.result,
                                                 .value = answer.value};
    impid_replies_remember(&core->replies, carrier, command, &response, now_us);
    respond(core, carrier, &response);
    if (answer.result != IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE) {
        core->rejected++;
        return;
    }
    core->accepted++;
    if (command->opcode == IMPID_MESSAGES_COMMAND_OPCODE_STATUS_CHOICE) {
        impid_output_status(core, carrier);
    } else if (command->opcode == IMPID_MESSAGES_COMMAND_OPCODE_RESET_CHOICE) {
        core->port->request_reset(core->port->context);
    }
}
