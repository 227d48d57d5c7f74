/* An update into a flash that obeys the rules of the real one, with the power cut after any byte of it, and
 * what the loader then starts. */
#include "fake_port.h"
#include "impid_crc32.h"

#include <setjmp.h>
#include <string.h>
#include <unity.h>

#define NEVER       0xFFFFFFFFu
#define IMAGE_WORDS 150u
/* An erase is cut after any so many bytes of the 64 KiB, the other operations after any byte. */
#define ERASE_STEP 1024u

#define BEGIN   IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_BEGIN_CHOICE
#define WRITE   IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_WRITE_CHOICE
#define END     IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_END_CHOICE
#define CONFIRM IMPID_MESSAGES_COMMAND_OPCODE_UPDATE_CONFIRM_CHOICE
#define OK      IMPID_MESSAGES_RESPONSE_RESULT_OK_CHOICE

static struct {
    uint32_t words[2][IMPID_SLOT_WORDS];
    uint32_t steps_left;
    jmp_buf power_cut;
    uint32_t operations_left;
} chip;

static impid_update_t update;
static uint32_t image[IMAGE_WORDS];
static uint32_t crc;

static void step(void) {
    if (chip.steps_left == 0u) {
        longjmp(chip.power_cut, 1);
    }
    chip.steps_left -= chip.steps_left != NEVER ? 1u : 0u;
}

static bool refuses(void) {
    if (chip.operations_left == 0u) {
        return true;
    }
    chip.operations_left -= chip.operations_left != NEVER ? 1u : 0u;
    return false;
}

static uint32_t chip_read(void *context, uint32_t slot, uint32_t word) {
    (void)context;
    return chip.words[slot][word];
}

static bool chip_program(void *context, uint32_t slot, uint32_t word, uint32_t value) {
    (void)context;
    if (refuses()) {
        return false;
    }
    for (uint32_t i = 0; i < 4u; i++) {
        step();
        chip.words[slot][word] &= value | ~(0xFFu << (8u * i));
    }
    return true;
}

/* Backwards, so that a cut leaves the header standing over a half-erased image: the worse order. */
static bool chip_erase(void *context, uint32_t slot) {
    (void)context;
    if (refuses()) {
        return false;
    }
    for (uint32_t end = IMPID_SLOT_WORDS; end > 0u; end -= ERASE_STEP / 4u) {
        step();
        memset(&chip.words[slot][end - ERASE_STEP / 4u], 0xFF, ERASE_STEP);
    }
    return true;
}

static const impid_flash_t flash = {
    .sector_words = IMPID_SLOT_WORDS, .read = chip_read, .program = chip_program, .erase = chip_erase};
static const impid_update_port_t port = {.flash = &flash, .base = {0x08010000u, 0x08020000u}, .running = 0};

/* Little-endian, as the processor and the file have it. */
static uint32_t crc_of(const uint32_t *words, uint32_t count) {
    static uint8_t bytes[4u * IMAGE_WORDS];
    for (uint32_t i = 0; i < 4u * count; i++) {
        bytes[i] = (uint8_t)(words[i / 4u] >> (8u * (i % 4u)));
    }
    return impid_crc32(bytes, 4u * count);
}

static void lay(uint32_t slot, uint32_t sequence, uint32_t tried, uint32_t confirmed) {
    memset(chip.words[slot], 0xFF, sizeof chip.words[slot]);
    memcpy(&chip.words[slot][IMPID_SLOT_IMAGE], image, sizeof image);
    const uint32_t header[] = {IMPID_SLOT_MARK, sizeof image, crc, sequence, tried, confirmed};
    memcpy(chip.words[slot], header, sizeof header);
}

void setUp(void) {
    memset(&chip.words, 0xFF, sizeof chip.words);
    chip.steps_left = NEVER;
    chip.operations_left = NEVER;
    for (uint32_t i = 0; i < IMAGE_WORDS; i++) {
        image[i] = i * 2654435761u;
    }
    image[1] = port.base[1] + 4u * IMPID_SLOT_IMAGE + 0x41u; /* starts within itself, in slot 1 */
    crc = crc_of(image, IMAGE_WORDS);
    lay(0, 7, 0, 0);
    impid_update_init(&update, &port);
}

void tearDown(void) {
}

static uint32_t chosen(void) {
    return impid_slots_choose(chip_read, NULL);
}

static impid_update_result_t send(void) {
    for (uint32_t i = 0; i < IMAGE_WORDS; i++) {
        impid_update_result_t result = impid_update_write(&update, (uint8_t)i, image[i]);
        if (result != IMPID_UPDATE_OK) {
            return result;
        }
    }
    return IMPID_UPDATE_OK;
}

static void test_the_checksum_is_that_of_the_bytes(void) {
    TEST_ASSERT_EQUAL_HEX32(crc, impid_slots_crc(chip_read, NULL, 0, IMAGE_WORDS));
}

static void test_a_new_image_is_tried_once_and_stays_if_it_is_confirmed(void) {
    TEST_ASSERT_EQUAL_UINT32(0, chosen());
    TEST_ASSERT_EQUAL_UINT32(1, impid_update_slot(&update));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_begin(&update, sizeof image));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, send());
    TEST_ASSERT_EQUAL_UINT32(0, chosen());
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_finish(&update, crc));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_finish(&update, crc)); /* the answer was lost */
    TEST_ASSERT_EQUAL_UINT32(1, chosen());
    TEST_ASSERT_EQUAL_UINT32(8, chip.words[1][IMPID_SLOT_AT_SEQUENCE]);

    chip.words[1][IMPID_SLOT_AT_TRIED] = 0; /* the loader, as it starts it */
    TEST_ASSERT_EQUAL_UINT32(0, chosen());

    impid_update_port_t there = port;
    there.running = 1;
    impid_update_t trial;
    impid_update_init(&trial, &there);
    TEST_ASSERT_FALSE(impid_update_confirmed(&trial));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_confirm(&trial));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_confirm(&trial));
    TEST_ASSERT_TRUE(impid_update_confirmed(&trial));
    TEST_ASSERT_EQUAL_UINT32(1, chosen());
}

static void test_what_the_loader_takes(void) {
    const struct {
        uint32_t sequence[2], tried[2], confirmed[2], expected;
    } cases[] = {
        {{7, 8}, {0, NEVER}, {0, NEVER}, 1},         /* new, never tried */
        {{9, 8}, {0, NEVER}, {0, NEVER}, 0},         /* older than what runs */
        {{7, 8}, {0, 0}, {0, NEVER}, 0},             /* tried in vain */
        {{7, 8}, {0, 0}, {0, 0}, 1},                 /* tried and confirmed */
        {{7, 8}, {0, 0}, {NEVER, NEVER}, 1},         /* both failed: the newer, which is better than none */
        {{7, 8}, {NEVER, NEVER}, {NEVER, NEVER}, 1}, /* neither tried */
    };
    for (uint32_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        for (uint32_t slot = 0; slot < 2u; slot++) {
            lay(slot, cases[i].sequence[slot], cases[i].tried[slot], cases[i].confirmed[slot]);
        }
        TEST_ASSERT_EQUAL_UINT32(cases[i].expected, chosen());
    }
    chip.words[1][IMPID_SLOT_IMAGE + 77u] ^= 0x100u; /* a bit of the newer one falls over */
    TEST_ASSERT_EQUAL_UINT32(0, chosen());
    chip.words[0][IMPID_SLOT_AT_BYTES] = 0xFFFFFFFCu;
    TEST_ASSERT_EQUAL_UINT32(IMPID_SLOT_NONE, chosen());
    lay(0, 1, 0, NEVER); /* failed, but alone */
    TEST_ASSERT_EQUAL_UINT32(0, chosen());
}

static void test_lengths_words_and_images_that_make_no_sense_are_refused(void) {
    const uint32_t lengths[] = {0, 3, 4u * (IMPID_SLOT_WORDS - IMPID_SLOT_IMAGE) + 4u, NEVER};
    for (uint32_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
        TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_VALUE, impid_update_begin(&update, lengths[i]));
    }
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_ITEM, impid_update_write(&update, 0, 1)); /* before begin */
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_ITEM, impid_update_finish(&update, 0));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_begin(&update, sizeof image));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK,
                      impid_update_begin(&update, sizeof image)); /* repeated: no second erase */
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_ITEM, impid_update_write(&update, 1, image[1]));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_write(&update, 0, image[0]));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_write(&update, 0, image[0])); /* its answer was lost */
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_ITEM, impid_update_write(&update, 0, image[0] + 1u));
    TEST_ASSERT_EQUAL_UINT32(1, update.next);
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_ITEM, impid_update_finish(&update, crc)); /* not all of it */
    for (uint32_t i = 1; i < IMAGE_WORDS; i++) {
        TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_write(&update, (uint8_t)i, image[i]));
    }
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_ITEM, impid_update_write(&update, (uint8_t)IMAGE_WORDS, 1));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_VALUE, impid_update_finish(&update, crc ^ 1u));
    TEST_ASSERT_EQUAL_UINT32(0, chosen());
}

static void test_an_image_for_the_other_slot_is_refused(void) {
    image[1] = port.base[0] + 4u * IMPID_SLOT_IMAGE + 0x41u;
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_begin(&update, sizeof image));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, send());
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_VALUE, impid_update_finish(&update, crc_of(image, IMAGE_WORDS)));
    image[1] = port.base[1] + 4u * IMPID_SLOT_IMAGE + (uint32_t)sizeof image; /* starts behind its end */
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, impid_update_begin(&update, sizeof image));
    TEST_ASSERT_EQUAL(IMPID_UPDATE_OK, send());
    TEST_ASSERT_EQUAL(IMPID_UPDATE_BAD_VALUE, impid_update_finish(&update, crc_of(image, IMAGE_WORDS)));
    TEST_ASSERT_EQUAL_UINT32(0, chosen());
}

static void test_a_flash_that_refuses_is_reported_and_the_old_image_stays(void) {
    /* Mark cleared, erase, words, four words of header. */
    for (uint32_t operations = 0; operations < 2u + IMAGE_WORDS + 4u; operations++) {
        setUp();
        chip.operations_left = operations;
        impid_update_result_t result = impid_update_begin(&update, sizeof image);
        result = result == IMPID_UPDATE_OK ? send() : result;
        result = result == IMPID_UPDATE_OK ? impid_update_finish(&update, crc) : result;
        TEST_ASSERT_EQUAL(IMPID_UPDATE_FAILED, result);
        TEST_ASSERT_EQUAL_UINT32(0, chosen());
    }
    setUp();
    chip.words[0][IMPID_SLOT_AT_CONFIRMED] = NEVER;
    chip.operations_left = 0;
    TEST_ASSERT_EQUAL(IMPID_UPDATE_FAILED, impid_update_confirm(&update));
}

static void install(void) {
    (void)impid_update_begin(&update, sizeof image);
    (void)send();
    (void)impid_update_finish(&update, crc);
}

static void test_a_power_cut_at_any_byte_leaves_the_old_image_or_the_new(void) {
    static uint32_t before[IMPID_SLOT_WORDS];
    static volatile bool finished;
    static volatile uint32_t cuts; /* these survive longjmp, as every static does */
    cuts = 0;
    for (finished = false; !finished; cuts++) {
        setUp();
        lay(1, 6, 0, 0); /* an older image lies where the update goes */
        memcpy(before, chip.words[0], sizeof before);
        chip.steps_left = cuts;
        if (setjmp(chip.power_cut) == 0) {
            install();
            finished = true;
        }
        chip.steps_left = NEVER;
        TEST_ASSERT_EQUAL_MEMORY(before, chip.words[0], sizeof before);
        /* The last byte of the mark may have been written before the power went. */
        bool complete = chip.words[1][IMPID_SLOT_AT_MARK] == IMPID_SLOT_MARK &&
                        chip.words[1][IMPID_SLOT_AT_SEQUENCE] == 8u;
        TEST_ASSERT_EQUAL_UINT32(complete ? 1u : 0u, chosen());
        TEST_ASSERT_TRUE(complete || !finished);
        /* And the next attempt goes through. */
        impid_update_init(&update, &port);
        install();
        TEST_ASSERT_EQUAL_UINT32(1, chosen());
    }
    TEST_ASSERT_GREATER_THAN_UINT32(4u * IMAGE_WORDS + 64u, cuts);
}

/* --- The commands -------------------------------------------------------------------------------- */

static fake_port_t fake;
static impid_core_t core;
static uint16_t next_id;

static struct impid_messages_response_t ask(uint8_t opcode, uint8_t item, uint32_t value) {
    fake_send_command(&core, IMPID_CARRIER_SERIAL, next_id++, opcode, item, value, fake.now_us);
    return fake_response(&fake);
}

static void check(struct impid_messages_response_t response, uint8_t result, uint32_t value) {
    TEST_ASSERT_EQUAL_UINT8(result, response.result);
    TEST_ASSERT_EQUAL_UINT32(value, response.value);
}

static void make_core(const impid_update_port_t *slots) {
    const impid_core_config_t config = {
        .slots = slots, .board_id = 0xB0A2Du, .build_commit = 0xC0FFEEu, .build_state = 0x0C020102u};
    fake_port_init(&fake);
    impid_core_init(&core, &config, &fake.port);
    next_id = 1;
}

static void test_commands_carry_an_update(void) {
    make_core(&port);
    const uint8_t info = IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE;
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_BUILD_COMMIT_CHOICE, 0), OK, 0xC0FFEEu);
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_BUILD_STATE_CHOICE, 0), OK, 0x0C020102u);
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_BOARD_ID_CHOICE, 0), OK, 0xB0A2Du);
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_UPDATE_SLOT_CHOICE, 0), OK, 1);
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_UPDATE_PENDING_CHOICE, 0), OK, 0);
    check(ask(IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 0, 0), OK, 0);
    check(ask(BEGIN, 0, sizeof image), IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE, 0);
    (void)ask(IMPID_MESSAGES_COMMAND_OPCODE_STOP_CHOICE, 0, 0);
    check(ask(BEGIN, 0, 5), IMPID_MESSAGES_RESPONSE_RESULT_BAD_VALUE_CHOICE, 1);
    check(ask(BEGIN, 0, sizeof image), OK, 1);
    check(ask(WRITE, 0, image[0]), OK, 1);
    /* A refusal says where to go on. */
    check(ask(WRITE, 5, image[5]), IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE, 1);
    for (uint32_t i = 1; i < IMAGE_WORDS; i++) {
        check(ask(WRITE, (uint8_t)i, image[i]), OK, i + 1u);
        fake_period(&core, &fake, 2048, 2048, 0);
        fake.frames = 0;
    }
    check(ask(END, 0, crc), OK, 1);
    TEST_ASSERT_EQUAL_UINT32(1, chosen());
    chip.words[0][IMPID_SLOT_AT_CONFIRMED] = NEVER; /* as if this one ran on trial */
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_UPDATE_PENDING_CHOICE, 0), OK, 1);
    check(ask(CONFIRM, 0, 0), OK, 0);
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_UPDATE_PENDING_CHOICE, 0), OK, 0);
    check(ask(IMPID_MESSAGES_COMMAND_OPCODE_SELF_TEST_CHOICE, 0, 0), OK, 0);
    check(ask(CONFIRM, 0, 1), IMPID_MESSAGES_RESPONSE_RESULT_BUSY_CHOICE, 0);
}

static void test_a_board_without_slots_knows_no_update(void) {
    make_core(NULL);
    for (uint8_t opcode = BEGIN; opcode <= CONFIRM; opcode++) {
        check(ask(opcode, 0, 4), IMPID_MESSAGES_RESPONSE_RESULT_UNKNOWN_OPCODE_CHOICE, 0);
    }
    const uint8_t info = IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE;
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_UPDATE_SLOT_CHOICE, 0), OK, IMPID_SLOT_NONE);
    check(ask(info, IMPID_MESSAGES_COMMAND_ITEM_UPDATE_PENDING_CHOICE, 0), OK, 0);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_the_checksum_is_that_of_the_bytes);
    RUN_TEST(test_a_new_image_is_tried_once_and_stays_if_it_is_confirmed);
    RUN_TEST(test_what_the_loader_takes);
    RUN_TEST(test_lengths_words_and_images_that_make_no_sense_are_refused);
    RUN_TEST(test_an_image_for_the_other_slot_is_refused);
    RUN_TEST(test_a_flash_that_refuses_is_reported_and_the_old_image_stays);
    RUN_TEST(test_a_power_cut_at_any_byte_leaves_the_old_image_or_the_new);
    RUN_TEST(test_commands_carry_an_update);
    RUN_TEST(test_a_board_without_slots_knows_no_update);
    return UNITY_END();
}
