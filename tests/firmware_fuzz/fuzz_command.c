/* The whole core as the wire sees it: a session of commands, foreign bytes, samples, stalls and full
 * carriers.
 *
 * The input is a sequence of steps, each an opcode byte (modulo STEPS) and its operands. Commands come
 * framed, as the checksum would otherwise keep the fuzzer out. Must hold for every session: a command is
 * answered once, on its carrier, under its own id; every frame of the serial line is whole and numbered
 * without a hole, those counted as dropped included; the samples of a batch follow each other; no counter
 * forgets a frame; of the slot that runs nothing but its confirmation is written, and the other one is marked
 * only while it is whole.
 */
#include "fuzz.h"

#include "impid_core.h"

#include <string.h>

#define SECTOR_WORDS   100u
#define PERIODS_MAX    1500u /* of a session: keeps it short */
#define BOOT_ID        0x1234u
#define RECORD_COMMAND 8u
#define SLOT_WORDS     512u /* behind them flash refuses */
#define RUNNING        1u

enum { STEP_SERIAL, STEP_CAN, STEP_RAW, STEP_PERIODS, STEP_STALL, STEP_MISSED, STEP_JUMP, STEP_ROOM, STEPS };

typedef struct {
    impid_port_t port;
    uint32_t now_us;
    bool full[IMPID_CARRIERS];
    bool pin;
    uint32_t resets;
    impid_frame_parser_t parser;
    uint32_t serial_frames; /* sent and refused */
    uint32_t can_frames;
    uint32_t answers[IMPID_CARRIERS]; /* RESPONSE and PONG, sent or refused */
    uint16_t answered_id;
    bool following; /* a batch of this stream was seen; the next one begins here or after a gap: */
    uint32_t next_index;
} wire_t;

static wire_t wire;
static impid_core_t core;
static uint32_t flash_words[IMPID_SETTINGS_SECTORS][SECTOR_WORDS];
static uint32_t slot_words[IMPID_SLOTS][SLOT_WORDS];

static uint32_t now_us(void *context) {
    return ((wire_t *)context)->now_us;
}

static void note_answer(wire_t *seen, impid_carrier_t carrier, const uint8_t *record) {
    seen->answers[carrier]++;
    seen->answered_id = (uint16_t)(record[0] | record[1] << 8);
}

static bool serial_send(void *context, const uint8_t *bytes, size_t count) {
    wire_t *seen = context;
    impid_frame_view_t frame;
    FUZZ_CHECK(count > 0u && count <= IMPID_FRAME_ENCODED_MAX && bytes[count - 1u] == 0u);
    bool whole = false;
    for (size_t i = 0; i < count; i++) {
        whole = impid_frame_parser_push(&seen->parser, bytes[i], &frame);
        FUZZ_CHECK(!whole || i + 1u == count);
    }
    FUZZ_CHECK(whole && frame.header.boot_id == BOOT_ID &&
               frame.header.frame_seq == (uint16_t)seen->serial_frames);
    seen->serial_frames++;
    uint8_t kind = frame.header.kind;
    FUZZ_CHECK(kind != IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE);
    if (kind == IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE) {
        struct impid_messages_accel_t accel;
        uint32_t skipped = frame.header.first_index - seen->next_index;
        FUZZ_CHECK(!seen->following || skipped == 0u ||
                   (skipped < 0x80000000u && (frame.header.flags & IMPID_BATCH_FLAG_GAP) != 0u));
        seen->following = true;
        seen->next_index = frame.header.first_index + frame.header.count;
        for (uint32_t i = 0; i < frame.header.count; i++) {
            (void)impid_messages_accel_unpack(&accel, &frame.records[i * IMPID_RECORD_SAMPLE], 8u);
            FUZZ_CHECK(accel.index_low16 == (uint16_t)(frame.header.first_index + i));
        }
    } else if (kind != IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE) {
        note_answer(seen, IMPID_CARRIER_SERIAL, frame.records);
    }
    return !seen->full[IMPID_CARRIER_SERIAL];
}

static bool can_send(void *context, const impid_can_frame_t *frame) {
    wire_t *seen = context;
    FUZZ_CHECK(frame->dlc == 8u && frame->id <= 0x7FFu && frame->id != IMPID_MESSAGES_COMMAND_FRAME_ID);
    seen->can_frames++;
    if (frame->id == IMPID_MESSAGES_RESPONSE_FRAME_ID || frame->id == IMPID_MESSAGES_PONG_FRAME_ID) {
        note_answer(seen, IMPID_CARRIER_CAN, frame->data);
    }
    return !seen->full[IMPID_CARRIER_CAN];
}

static uint32_t backlog_us(void *context, impid_carrier_t carrier) {
    (void)carrier;
    return ((wire_t *)context)->now_us >> 8;
}

static void self_test_pin(void *context, bool drive) {
    FUZZ_CHECK(((wire_t *)context)->pin != drive);
    ((wire_t *)context)->pin = drive;
}

static impid_port_health_t health(void *context) {
    (void)context;
    return (impid_port_health_t){.supply_mV = 3300};
}

static void request_reset(void *context) {
    ((wire_t *)context)->resets++;
}

static uint32_t flash_read(void *context, uint32_t sector, uint32_t word) {
    (void)context;
    FUZZ_CHECK(sector < IMPID_SETTINGS_SECTORS && word < SECTOR_WORDS);
    return flash_words[sector][word];
}

static bool flash_program(void *context, uint32_t sector, uint32_t word, uint32_t value) {
    (void)context;
    FUZZ_CHECK(sector < IMPID_SETTINGS_SECTORS && word < SECTOR_WORDS);
    flash_words[sector][word] &= value;
    return true;
}

static bool flash_erase(void *context, uint32_t sector) {
    (void)context;
    FUZZ_CHECK(sector < IMPID_SETTINGS_SECTORS);
    memset(flash_words[sector], 0xFF, sizeof flash_words[sector]);
    return true;
}

static const impid_flash_t flash = {NULL, SECTOR_WORDS, flash_read, flash_program, flash_erase};

static uint32_t slot_read(void *context, uint32_t slot, uint32_t word) {
    (void)context;
    FUZZ_CHECK(slot < IMPID_SLOTS && word < IMPID_SLOT_WORDS);
    return word < SLOT_WORDS ? slot_words[slot][word] : IMPID_SLOT_UNWRITTEN;
}

static bool slot_program(void *context, uint32_t slot, uint32_t word, uint32_t value) {
    (void)context;
    FUZZ_CHECK(slot < IMPID_SLOTS && word < IMPID_SLOT_WORDS);
    FUZZ_CHECK(slot != RUNNING || word == IMPID_SLOT_AT_CONFIRMED);
    if (word >= SLOT_WORDS) {
        return false;
    }
    slot_words[slot][word] &= value;
    return true;
}

static bool slot_erase(void *context, uint32_t slot) {
    (void)context;
    FUZZ_CHECK(slot < IMPID_SLOTS && slot != RUNNING);
    memset(slot_words[slot], 0xFF, sizeof slot_words[slot]);
    return true;
}

static const impid_flash_t slots_flash = {NULL, IMPID_SLOT_WORDS, slot_read, slot_program, slot_erase};
static const impid_update_port_t slots = {&slots_flash, {0x08010000u, 0x08020000u}, RUNNING};

static bool bench_act(void *context, uint8_t item, uint32_t value, uint32_t *answer) {
    (void)context;
    *answer = value + item;
    return item < 105u;
}

static const impid_bench_port_t bench_port = {NULL, bench_act};

static void check_slots(void) {
    const uint32_t other = (RUNNING + 1u) % IMPID_SLOTS;
    FUZZ_CHECK(slot_words[other][IMPID_SLOT_AT_MARK] != IMPID_SLOT_MARK ||
               impid_slots_whole(slot_read, NULL, other));
}

static void check_counters(void) {
    const impid_link_t *serial = &core.links[IMPID_CARRIER_SERIAL];
    const impid_link_t *can = &core.links[IMPID_CARRIER_CAN];
    FUZZ_CHECK(serial->frames_sent + serial->frames_dropped == wire.serial_frames);
    FUZZ_CHECK(can->frames_sent + can->frames_dropped == wire.can_frames);
    FUZZ_CHECK(!(impid_stream_active(&core.stream) && impid_selftest_running(&core.selftest)));
    FUZZ_CHECK(impid_ring_lost(&core.sampler.ring) <= core.sampler.produced);
    wire.following = wire.following && core.stream.on[IMPID_CARRIER_SERIAL];
}

static void command(fuzz_input_t *input, impid_carrier_t carrier, uint16_t id, uint8_t dlc) {
    uint8_t record[RECORD_COMMAND];
    for (uint32_t i = 0; i < sizeof record; i++) {
        record[i] = (uint8_t)fuzz_take(input, 1);
    }
    uint32_t before = wire.answers[carrier];
    uint32_t judged = core.accepted + core.rejected;
    uint32_t age_us = fuzz_take(input, 2);
    bool expected = true;
    if (carrier == IMPID_CARRIER_SERIAL) {
        struct impid_messages_batch_t header = {
            .kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 1};
        uint8_t encoded[IMPID_FRAME_ENCODED_MAX + 1u] = {0}; /* a delimiter first: raw bytes may lie before */
        size_t length = impid_frame_encode(&header, record, &encoded[1]) + 1u;
        impid_core_serial_receive(&core, encoded, 1u, wire.now_us - age_us);
        before = wire.answers[carrier]; /* the raw bytes may have been a command by themselves */
        judged = core.accepted + core.rejected;
        impid_core_serial_receive(&core, &encoded[1], length - 1u, wire.now_us - age_us);
    } else {
        impid_can_frame_t frame = {.id = id, .dlc = dlc};
        memcpy(frame.data, record, sizeof frame.data);
        impid_core_can_receive(&core, &frame, wire.now_us - age_us);
        expected = id == IMPID_MESSAGES_COMMAND_FRAME_ID && dlc == 8u;
    }
    FUZZ_CHECK(core.accepted + core.rejected - judged <= 1u);
    FUZZ_CHECK(wire.answers[carrier] - before == (expected ? 1u : 0u));
    FUZZ_CHECK(!expected || wire.answered_id == (uint16_t)(record[0] | record[1] << 8));
}

/* One period with the readings that the seed makes; the main loop runs unless stalled. */
static void period(uint32_t seed, uint8_t flags, bool stalled) {
    uint16_t adc[2u * IMPID_OVERSAMPLING];
    for (uint32_t i = 0; i < 2u * IMPID_OVERSAMPLING; i++) {
        adc[i] = (uint16_t)((seed * (2u * i + 1u)) & 0xFFFu);
    }
    wire.now_us += IMPID_PERIOD_US;
    impid_tick_t tick = {
        .adc = adc, .encoder = {seed * 2654435761u, ~seed}, .t_us = wire.now_us, .flags = flags};
    impid_core_tick(&core, &tick);
    if (!stalled) {
        impid_core_poll(&core);
    }
}

static uint32_t run_periods(fuzz_input_t *input, uint32_t left, bool stalled) {
    uint32_t count = fuzz_take(input, 1) * (stalled ? 2u : 1u);
    uint32_t seed = fuzz_take(input, 1);
    uint8_t flags =
        (uint8_t)(fuzz_take(input, 1) & (IMPID_FLAG_LATE | IMPID_FLAG_ENCODER_FAULT | IMPID_FLAG_SYNC_EDGE));
    count = count < left ? count : left;
    for (uint32_t i = 0; i < count; i++) {
        period(seed + i, flags, stalled);
    }
    return left - count;
}

static uint32_t step(fuzz_input_t *input, uint32_t left) {
    uint32_t count;
    uint16_t id;
    switch (fuzz_take(input, 1) % STEPS) {
    case STEP_SERIAL:
        command(input, IMPID_CARRIER_SERIAL, 0u, 0u);
        return left;
    case STEP_CAN:
        id = (uint16_t)(fuzz_take(input, 2) & 0x7FFu);
        command(input, IMPID_CARRIER_CAN, id, (uint8_t)(fuzz_take(input, 1) % 9u));
        return left;
    case STEP_RAW:
        count = fuzz_take(input, 1);
        count = count < input->left ? count : (uint32_t)input->left;
        impid_core_serial_receive(&core, input->data, count, wire.now_us);
        input->data += count;
        input->left -= count;
        wire.following = false; /* commands may have been among them */
        return left;
    case STEP_PERIODS:
        return run_periods(input, left, false);
    case STEP_STALL:
        return run_periods(input, left, true);
    case STEP_MISSED:
        count = fuzz_take(input, 1);
        wire.now_us += count * IMPID_PERIOD_US;
        impid_core_missed(&core, count);
        return left;
    case STEP_JUMP: /* the longest that the time may go unread: from a look to the next */
        impid_core_poll(&core);
        wire.now_us += fuzz_take(input, 4) & 0x7FFFFFFFu;
        impid_core_poll(&core);
        return left;
    default:
        count = fuzz_take(input, 1);
        wire.full[IMPID_CARRIER_SERIAL] = (count & 1u) != 0u;
        wire.full[IMPID_CARRIER_CAN] = (count & 2u) != 0u;
        return left;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz_input_t input = {data, size};
    static const uint32_t log_words[4] = {1, 2, 3, 4};
    impid_settings_t settings;
    memset(&wire, 0, sizeof wire);
    memset(flash_words, 0xFF, sizeof flash_words);
    memset(slot_words, 0xFF, sizeof slot_words);
    wire.port = (impid_port_t){&wire,      now_us,        serial_send, can_send,
                               backlog_us, self_test_pin, health,      request_reset};
    impid_frame_parser_init(&wire.parser);
    impid_settings_init(&settings, &flash);
    FUZZ_CHECK(impid_settings_prepare(&settings));
    const uint8_t has = (uint8_t)fuzz_take(&input, 1);
    const impid_core_config_t config = {.boot_id = BOOT_ID,
                                        .first_index = fuzz_take(&input, 4),
                                        .settings = (has & 1u) != 0u ? &settings : NULL,
                                        .log = (has & 2u) != 0u ? log_words : NULL,
                                        .log_words = 4,
                                        .slots = (has & 4u) != 0u ? &slots : NULL,
                                        .bench = (has & 8u) != 0u ? &bench_port : NULL};
    impid_core_init(&core, &config, &wire.port);
    uint32_t left = PERIODS_MAX;
    while (input.left > 0u) {
        left = step(&input, left);
        check_counters();
        check_slots();
    }
    return 0;
}
