/* The same core with another sensor: what the descriptor says, the stream, the self-test and INFO must show.
 */
#include "fake_port.h"

#include <unity.h>

static fake_port_t fake;
static impid_core_t core;

static void begin(const impid_sensor_t *sensor) {
    const impid_core_config_t config = {.sensor = sensor, .first_index = 50};
    fake_port_init(&fake);
    impid_core_init(&core, &config, &fake.port);
}

void setUp(void) {
    begin(&impid_adxl355);
}

void tearDown(void) {
}

/* A tick of the digital sensor: three readings of 20 bits. */
static void digital(uint32_t x, uint32_t y, uint32_t z, uint32_t encoder) {
    const uint32_t wide[3] = {x, y, z};
    fake.now_us += IMPID_PERIOD_US;
    impid_tick_t tick = {.wide = wide, .encoder = {encoder, ~encoder}, .t_us = fake.now_us};
    impid_core_tick(&core, &tick);
    impid_core_poll(&core);
}

static void start(impid_carrier_t carrier) {
    fake_send_command(&core, carrier, 1, IMPID_MESSAGES_COMMAND_OPCODE_START_CHOICE, 0, 0, 0);
}

static uint32_t info(uint8_t item) {
    fake_send_command(&core, IMPID_CARRIER_SERIAL, (uint16_t)(100u + item),
                      IMPID_MESSAGES_COMMAND_OPCODE_INFO_CHOICE, item, 0, 0);
    return fake_response(&fake).value;
}

static void test_a_wide_record_holds_three_codes_of_24_bits(void) {
    start(IMPID_CARRIER_SERIAL);
    for (uint32_t k = 0; k < 12u; k++) {
        digital(0x12340u + k, 0xABCDEu, 0x80001u, 0xF0000000u + k);
    }
    const uint8_t *record = fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_WIDE_CHOICE);
    struct impid_messages_accel_t accel;
    struct impid_messages_encoder_t encoder;
    struct impid_messages_accel_fine_t fine;
    for (uint32_t i = 0; i < IMPID_BATCH_SAMPLES; i++) {
        /* The first sample leaves at tick 2, when its own instant, two before, is known. */
        (void)impid_messages_accel_unpack(&accel, &record[24u * i], 8);
        (void)impid_messages_encoder_unpack(&encoder, &record[24u * i + 8u], 8);
        (void)impid_messages_accel_fine_unpack(&fine, &record[24u * i + 16u], 8);
        TEST_ASSERT_EQUAL_HEX32((0x12340u + 2u + i) << 4, (uint32_t)accel.ax << 8 | fine.ax_low8);
        TEST_ASSERT_EQUAL_HEX32(0xABCDE0u, (uint32_t)accel.ay << 8 | fine.ay_low8);
        TEST_ASSERT_EQUAL_HEX32(0x800010u, (uint32_t)fine.az_high16 << 8 | fine.az_low8);
        TEST_ASSERT_EQUAL_UINT32(i, encoder.enc1_low28);
        TEST_ASSERT_EQUAL_UINT8(15, accel.enc1_high4);
        TEST_ASSERT_EQUAL_UINT16(50u + i, accel.index_low16);
        TEST_ASSERT_EQUAL_UINT16(50u + i, fine.index_low16);
        TEST_ASSERT_EQUAL_UINT8(50u + i, encoder.index_low8);
        TEST_ASSERT_EQUAL_HEX8(i == 0u ? IMPID_FLAG_FINE | IMPID_FLAG_RESET : IMPID_FLAG_FINE, accel.flags);
    }
    TEST_ASSERT_EQUAL_UINT32(0, fake_count(&fake, IMPID_MESSAGES_BATCH_KIND_SAMPLES_CHOICE));
    /* Time of the first: that of tick 0. */
    TEST_ASSERT_EQUAL_UINT64(IMPID_PERIOD_US, fake.headers[fake.frames - 1u].t0_us);
}

static void test_on_can_the_fine_half_comes_first(void) {
    start(IMPID_CARRIER_CAN);
    for (uint32_t k = 0; k < 4u; k++) {
        digital(0x11111u, 0x22222u, 0x33333u, k);
    }
    const uint16_t expected[] = {
        IMPID_MESSAGES_RESPONSE_FRAME_ID,   IMPID_MESSAGES_TIME_FRAME_ID,  IMPID_MESSAGES_EPOCH_FRAME_ID,
        IMPID_MESSAGES_ACCEL_FINE_FRAME_ID, IMPID_MESSAGES_ACCEL_FRAME_ID, IMPID_MESSAGES_ENCODER_FRAME_ID,
        IMPID_MESSAGES_ACCEL_FINE_FRAME_ID, IMPID_MESSAGES_ACCEL_FRAME_ID, IMPID_MESSAGES_ENCODER_FRAME_ID};
    TEST_ASSERT_EQUAL_UINT32(sizeof expected / sizeof expected[0], fake.can_frames);
    for (uint32_t i = 0; i < fake.can_frames; i++) {
        TEST_ASSERT_EQUAL_HEX16(expected[i], fake.can[i].id);
    }
}

/* What was read before a gap is not paired with instants behind it, nor the reverse. */
static void test_missed_ticks_cost_their_own_and_the_delay(void) {
    impid_sampler_start(&core.sampler, 0);
    for (uint32_t k = 0; k < 10u; k++) {
        const uint32_t wide[3] = {k, k, k};
        impid_tick_t tick = {.wide = wide, .encoder = {k, k}, .t_us = 1000u * k};
        if (k == 5u) {
            impid_core_missed(&core, 3);
        }
        if (k < 5u || k > 7u) {
            impid_core_tick(&core, &tick);
        }
    }
    impid_sample_t sample;
    uint32_t delivered = 0;
    while (impid_ring_pop(&core.sampler.ring, &sample)) {
        TEST_ASSERT_EQUAL_UINT32(sample.encoder[0] * 1000u, sample.t_us);
        TEST_ASSERT_EQUAL_HEX32((sample.encoder[0] + 2u) << 4,
                                (uint32_t)sample.accel[0] << 8 | sample.fine[0]);
        delivered++;
    }
    TEST_ASSERT_EQUAL_UINT32(3, delivered); /* at ticks 2, 3 and 4; 8 and 9 refill */
    TEST_ASSERT_EQUAL_UINT32(3u + 2u, core.sampler.overruns);
    TEST_ASSERT_EQUAL_UINT32(delivered + core.sampler.overruns, core.sampler.produced);
}

static void test_either_rail_of_any_axis_flags_the_sample(void) {
    impid_sampler_start(&core.sampler, 0);
    const uint32_t readings[][3] = {{1, 1, 1},       {1, 1, 1}, {1, 1, 1},       {0, 1, 1},
                                    {1, 0xFFFFF, 1}, {1, 1, 0}, {1, 1, 0xFFFFF}, {0xFFFFE, 1, 1}};
    const uint8_t flagged[] = {0, 1, 1, 1, 1, 0};
    for (uint32_t k = 0; k < 8u; k++) {
        impid_tick_t tick = {.wide = readings[k]};
        impid_core_tick(&core, &tick);
    }
    impid_sample_t sample;
    for (uint32_t k = 0; k < 6u; k++) {
        TEST_ASSERT_TRUE(impid_ring_pop(&core.sampler.ring, &sample));
        TEST_ASSERT_EQUAL_HEX8(flagged[k] ? IMPID_FLAG_SATURATED : 0u, sample.flags);
    }
    TEST_ASSERT_EQUAL_UINT32(4, core.sampler.saturated);
}

/* 256000 codes a g: runs a self-test with a sensor that answers by so many thousandths of a g. */
static uint8_t verdict(uint32_t x_m, uint32_t y_m, uint32_t z_m) {
    begin(&impid_adxl355);
    fake_send_command(&core, IMPID_CARRIER_SERIAL, 1, IMPID_MESSAGES_COMMAND_OPCODE_SELF_TEST_CHOICE, 0, 0,
                      0);
    for (uint32_t i = 0; i < 400u; i++) {
        uint32_t on = fake.pin ? 256u : 0u;
        digital(0x80000u + on * x_m, 0x7F000u + on * y_m, 0x10000u + on * z_m, 0);
    }
    struct impid_messages_status_health_t health;
    const uint8_t *status = fake_last_record(&fake, IMPID_MESSAGES_BATCH_KIND_STATUS_CHOICE);
    (void)impid_messages_status_health_unpack(&health, &status[40], 8);
    return health.self_test;
}

static void test_self_test_of_three_axes_by_limits_of_their_own(void) {
    fake.supply_mV = 2500; /* no matter */
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE, verdict(300, 310, 1500));
    TEST_ASSERT_INT32_WITHIN(1, 300, (int32_t)info(IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_X_MV_CHOICE));
    TEST_ASSERT_INT32_WITHIN(1, 310, (int32_t)info(IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_Y_MV_CHOICE));
    TEST_ASSERT_INT32_WITHIN(1, 1500, (int32_t)info(IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_Z_MV_CHOICE));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE, verdict(152, 598, 2998));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_X_CHOICE, verdict(148, 300, 1500));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Y_CHOICE, verdict(300, 602, 1500));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_BOTH_CHOICE, verdict(0, 0, 1500));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Z_CHOICE, verdict(300, 300, 600));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_X_Z_CHOICE, verdict(0, 300, 3100));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Y_Z_CHOICE, verdict(300, 0, 0));
    TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_ALL_CHOICE, verdict(0, 0, 0));
}

static void test_info_of_the_digital_sensor(void) {
    TEST_ASSERT_EQUAL_UINT32(2, info(IMPID_MESSAGES_COMMAND_ITEM_SENSOR_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(3, info(IMPID_MESSAGES_COMMAND_ITEM_AXES_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(20, info(IMPID_MESSAGES_COMMAND_ITEM_READING_BITS_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(1, info(IMPID_MESSAGES_COMMAND_ITEM_OVERSAMPLING_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(2000, info(IMPID_MESSAGES_COMMAND_ITEM_GROUP_DELAY_US_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(16777216, info(IMPID_MESSAGES_COMMAND_ITEM_FULL_SCALE_CODE_CHOICE));
    TEST_ASSERT_EQUAL_UINT32(4096, info(IMPID_MESSAGES_COMMAND_ITEM_VREF_MV_CHOICE));
}

static void test_info_of_the_analog_sensors(void) {
    const impid_sensor_t *sensors[] = {NULL, &impid_adxl203, &impid_adxl203_oversampled};
    const uint32_t bits[] = {12, 12, 16};
    const uint32_t delays_us[] = {2006, 2006, 2000};
    for (uint32_t i = 0; i < 3u; i++) {
        begin(sensors[i]);
        TEST_ASSERT_EQUAL_UINT32(1, info(IMPID_MESSAGES_COMMAND_ITEM_SENSOR_CHOICE));
        TEST_ASSERT_EQUAL_UINT32(2, info(IMPID_MESSAGES_COMMAND_ITEM_AXES_CHOICE));
        TEST_ASSERT_EQUAL_UINT32(bits[i], info(IMPID_MESSAGES_COMMAND_ITEM_READING_BITS_CHOICE));
        TEST_ASSERT_EQUAL_UINT32(8, info(IMPID_MESSAGES_COMMAND_ITEM_OVERSAMPLING_CHOICE));
        TEST_ASSERT_EQUAL_UINT32(delays_us[i], info(IMPID_MESSAGES_COMMAND_ITEM_GROUP_DELAY_US_CHOICE));
        TEST_ASSERT_EQUAL_UINT32(65536, info(IMPID_MESSAGES_COMMAND_ITEM_FULL_SCALE_CODE_CHOICE));
        TEST_ASSERT_EQUAL_UINT32(3300, info(IMPID_MESSAGES_COMMAND_ITEM_VREF_MV_CHOICE));
        (void)info(IMPID_MESSAGES_COMMAND_ITEM_SELF_TEST_Z_MV_CHOICE);
        TEST_ASSERT_EQUAL_UINT8(IMPID_MESSAGES_RESPONSE_RESULT_BAD_ITEM_CHOICE, fake_response(&fake).result);
    }
}

static void test_sixteen_bits_pass_the_filter_as_they_are(void) {
    begin(&impid_adxl203_oversampled);
    impid_sampler_start(&core.sampler, 0);
    const uint16_t codes[] = {1, 2, 32767, 32768, 40001, 65518, 65519};
    for (uint32_t n = 0; n < 7u; n++) {
        uint16_t adc[16];
        for (uint32_t j = 0; j < 16u; j++) {
            adc[j] = j % 2u == 0u ? codes[n] : 30000u;
        }
        impid_tick_t tick = {.adc = adc};
        impid_sample_t sample = {0};
        for (uint32_t i = 0; i < 4u; i++) {
            impid_core_tick(&core, &tick);
        }
        while (impid_ring_pop(&core.sampler.ring, &sample)) {
        }
        TEST_ASSERT_EQUAL_UINT16(codes[n], sample.accel[0]);
        TEST_ASSERT_EQUAL_UINT16(30000, sample.accel[1]);
        TEST_ASSERT_EQUAL_HEX8(0, sample.flags);
    }
}

static void test_the_rail_of_sixteen_added_conversions(void) {
    begin(&impid_adxl203_oversampled);
    impid_sampler_start(&core.sampler, 0);
    uint16_t adc[16];
    for (uint32_t j = 0; j < 16u; j++) {
        adc[j] = j == 15u ? 16u * 4095u : 30000u;
    }
    impid_tick_t tick = {.adc = adc};
    impid_sample_t sample = {0};
    for (uint32_t i = 0; i < 4u; i++) {
        impid_core_tick(&core, &tick);
    }
    TEST_ASSERT_TRUE(impid_ring_pop(&core.sampler.ring, &sample));
    TEST_ASSERT_EQUAL_HEX8(IMPID_FLAG_SATURATED, sample.flags);
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_wide_record_holds_three_codes_of_24_bits);
    RUN_TEST(test_on_can_the_fine_half_comes_first);
    RUN_TEST(test_missed_ticks_cost_their_own_and_the_delay);
    RUN_TEST(test_either_rail_of_any_axis_flags_the_sample);
    RUN_TEST(test_self_test_of_three_axes_by_limits_of_their_own);
    RUN_TEST(test_info_of_the_digital_sensor);
    RUN_TEST(test_info_of_the_analog_sensors);
    RUN_TEST(test_sixteen_bits_pass_the_filter_as_they_are);
    RUN_TEST(test_the_rail_of_sixteen_added_conversions);
    return UNITY_END();
}
