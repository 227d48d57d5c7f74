/* The C side of the byte vectors: `vectors write FOLDER` records a session of the native board, and
 * `vectors parse` prints as JSON what the core's parser makes of the bytes on its standard input. */
#include "impid_board.h"
#include "impid_frame.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Index and time wrap inside the session; the main loop stalls for longer than the ring lasts. */
#define FIRST_INDEX 0xFFFFFFF0u
#define START_US    (0x100000000ull - 50000ull)
#define TICKS       700u
#define STALL_FROM  200u
#define STALL_TO    500u

static uint8_t serial[1u << 16];
static impid_board_can_frame can[1u << 13];

static void command(impid_board *board, uint8_t carrier, uint16_t id, uint8_t opcode, uint8_t item,
                    uint64_t t_us) {
    struct impid_messages_command_t message = {.request_id = id, .opcode = opcode, .item = item};
    struct impid_messages_batch_t header = {
        .kind = IMPID_MESSAGES_BATCH_KIND_COMMAND_CHOICE, .version = IMPID_PROTOCOL_VERSION, .count = 1};
    uint8_t record[8];
    (void)impid_messages_command_pack(record, &message, sizeof record);
    if (carrier == 0u) {
        uint8_t encoded[IMPID_FRAME_ENCODED_MAX];
        impid_board_serial_receive(board, encoded, impid_frame_encode(&header, record, encoded), t_us);
    } else {
        impid_board_can_frame frame = {.id = IMPID_MESSAGES_COMMAND_FRAME_ID, .dlc = 8};
        memcpy(frame.data, record, sizeof record);
        impid_board_can_receive(board, &frame, t_us);
    }
}

/* The inputs, as formulas that the Python side repeats. */
static void tick_inputs(uint32_t tick, uint16_t adc[16], int32_t encoder[2], uint8_t *fault) {
    for (uint32_t j = 0; j < 8u; j++) {
        uint32_t n = 8u * tick + j;
        adc[2u * j] = (uint16_t)(500u + n * n % 3001u);
        adc[2u * j + 1u] = (uint16_t)(tick == 120u ? 4095u : 3900u - 5u * n % 3701u);
    }
    encoder[0] = (int32_t)(0x80000000u + 1000003u * tick);
    encoder[1] = (int32_t)(0u - 7u * tick);
    *fault = (uint8_t)((tick == 60u ? IMPID_BOARD_ENCODER_FAULT : 0u) |
                       (tick == 70u ? IMPID_BOARD_SYNC_EDGE : 0u) | (tick == 80u ? IMPID_BOARD_LATE : 0u) |
                       (tick >= STALL_FROM && tick < STALL_TO ? IMPID_BOARD_STALLED : 0u));
}

static void run_session(impid_board *board) {
    for (uint32_t tick = 0; tick < TICKS; tick++) {
        uint16_t adc[16];
        int32_t encoder[2];
        uint8_t fault;
        tick_inputs(tick, adc, encoder, &fault);
        impid_board_run(board, 1, adc, encoder, &fault);
        uint64_t now = START_US + 1000ull * tick;
        for (uint32_t carrier = 0; carrier < 2u; carrier++) {
            uint16_t id = (uint16_t)(1000u * carrier + tick);
            if (tick == 10u) {
                command(board, (uint8_t)carrier, id, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 0,
                        now + 100u);
            } else if (tick == 150u) {
                command(board, (uint8_t)carrier, id, IMPID_MESSAGES_COMMAND_OPCODE_PING_CHOICE, 0,
                        now + 123u);
            } else if (tick == 160u) {
                command(board, (uint8_t)carrier, id, IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE,
                        IMPID_MESSAGES_COMMAND_ITEM_GROUP_DELAY_US_CHOICE, now + 200u);
            } else if (tick == 170u) {
                command(board, (uint8_t)carrier, id, 99, 0, now + 300u);
            } else if (tick == 690u) {
                command(board, (uint8_t)carrier, id, IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE, 0,
                        now + 400u);
            }
        }
    }
}

static void print_record(FILE *out, uint8_t kind, const uint8_t *record) {
    if (kind == IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE) {
        struct impid_messages_accel_t a;
        struct impid_messages_encoder_t e;
        (void)impid_messages_accel_unpack(&a, record, 8);
        (void)impid_messages_encoder_unpack(&e, record + 8, 8);
        uint32_t enc1 = (uint32_t)a.enc1_high4 << 28 | e.enc1_low28;
        uint32_t enc2 = (uint32_t)a.enc2_high4 << 28 | e.enc2_low28;
        fprintf(out, "{\"ax\": %u, \"ay\": %u, \"enc1\": %" PRId32 ", \"enc2\": %" PRId32 ", \"flags\": %u}",
                a.ax, a.ay, (int32_t)enc1, (int32_t)enc2, a.flags);
        return;
    }
    fprintf(out, "\"");
    for (size_t i = 0; i < impid_frame_record_size(kind); i++) {
        fprintf(out, "%02x", record[i]);
    }
    fprintf(out, "\"");
}

static void print_frames(FILE *out, const uint8_t *bytes, size_t count) {
    impid_frame_parser_t parser;
    impid_frame_parser_init(&parser);
    impid_frame_view_t frame;
    fprintf(out, "{\"frames\": [");
    const char *separator = "\n";
    for (size_t i = 0; i < count; i++) {
        if (!impid_frame_parser_push(&parser, bytes[i], &frame)) {
            continue;
        }
        const struct impid_messages_batch_t *h = &frame.header;
        fprintf(out,
                "%s{\"kind\": %u, \"version\": %u, \"boot_id\": %u, \"frame_seq\": %u, \"flags\": %u, "
                "\"first_index\": %" PRIu32 ", \"t0_us\": %" PRIu64 ", \"records\": [",
                separator, h->kind, h->version, h->boot_id, h->frame_seq, h->flags, h->first_index, h->t0_us);
        for (uint32_t n = 0; n < h->count; n++) {
            fprintf(out, n == 0u ? "\n  " : ",\n  ");
            print_record(out, h->kind, frame.records + n * impid_frame_record_size(h->kind));
        }
        fprintf(out, "]}");
        separator = ",\n";
    }
    fprintf(out, "\n], \"damaged\": %" PRIu32 ", \"foreign\": %" PRIu32 "}\n", parser.damaged,
            parser.foreign);
}

static FILE *open_in(const char *folder, const char *name) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    if (file == NULL) {
        perror(path);
        exit(1);
    }
    return file;
}

static int write_vectors(const char *folder) {
    impid_board_config config = {.uid = {0x11223344u, 0x55667788u, 0x99AABBCCu},
                                 .boot_id = 0xBEEFu,
                                 .reset_cause = 1,
                                 .first_index = FIRST_INDEX,
                                 .start_us = START_US};
    impid_board *board = impid_board_new(&config);
    if (board == NULL) {
        return 1;
    }
    run_session(board);
    size_t bytes = impid_board_serial_take(board, serial, sizeof serial);
    size_t frames = impid_board_can_take(board, can, sizeof can / sizeof can[0]);
    impid_board_free(board);

    FILE *file = open_in(folder, "serial.bin");
    fwrite(serial, 1, bytes, file);
    fclose(file);
    file = open_in(folder, "serial.json");
    print_frames(file, serial, bytes);
    fclose(file);
    file = open_in(folder, "can.bin");
    for (size_t i = 0; i < frames; i++) {
        uint8_t head[3] = {(uint8_t)can[i].id, (uint8_t)(can[i].id >> 8), can[i].dlc};
        fwrite(head, 1, sizeof head, file);
        fwrite(can[i].data, 1, sizeof can[i].data, file);
    }
    fclose(file);
    return 0;
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "write") == 0) {
        return write_vectors(argv[2]);
    }
    if (argc == 2 && strcmp(argv[1], "parse") == 0) {
        size_t count = fread(serial, 1, sizeof serial, stdin);
        print_frames(stdout, serial, count);
        return 0;
    }
    fprintf(stderr, "usage: vectors write FOLDER | vectors parse < BYTES\n");
    return 2;
}
