#include "impid_sensor.h"

/* ADXL103/ADXL203 data sheet: at 5 V the self-test moves an output by 400 mV (min), 750 mV (typ), 1100 mV
 * (max); in volts it goes with the cube of the supply (same sheet, operation at other voltages). The delay
 * is 13.5 conversions of 125 us in the decimator and 318.3 us by 10 nF against the sensor's own 32 kOhm. */
const impid_sensor_t impid_adxl203 = {
    .id = IMPID_SENSOR_ADXL203,
    .axes = 2u,
    .readings = 8u,
    .reading_bits = 12u,
    .reading_max = 4095u,
    .wide = false,
    .delay_ticks = 2u,
    .group_delay_us = 2006u,
    .full_scale_m = 0u,
    .self_test = {{400u, 1100u}, {400u, 1100u}, {0u, 0u}},
    .self_test_at_mV = 5000u,
};

/* The mean instant of the 16 conversions is 5.6 us behind the trigger (sampling.h of the board). */
const impid_sensor_t impid_adxl203_oversampled = {
    .id = IMPID_SENSOR_ADXL203,
    .axes = 2u,
    .readings = 8u,
    .reading_bits = 16u,
    .reading_max = 16u * 4095u,
    .wide = false,
    .delay_ticks = 2u,
    .group_delay_us = 2000u,
    .full_scale_m = 0u,
    .self_test = {{400u, 1100u}, {400u, 1100u}, {0u, 0u}},
    .self_test_at_mV = 5000u,
};

#if IMPID_AXES_MAX > 2u
/* ADXL354/ADXL355 data sheet: +-2.048 g over 20 bits (256000 codes a g); at 1000 Hz the digital filter passes
 * 250 Hz and delays by 1.78 periods. The port raises SYNC 220 us before the tick, which makes it two ticks.
 * The sheet gives the self-test's response as 0.3 g, 0.3 g and 1.5 g, typical, without limits: half and twice
 * are ours. */
const impid_sensor_t impid_adxl355 = {
    .id = IMPID_SENSOR_ADXL355,
    .axes = 3u,
    .readings = 1u,
    .reading_bits = 20u,
    .reading_max = 0xFFFFFu,
    .wide = true,
    .delay_ticks = 2u,
    .group_delay_us = 2000u,
    .full_scale_m = 4096u,
    .self_test = {{150u, 600u}, {150u, 600u}, {750u, 3000u}},
    .self_test_at_mV = 0u,
};
#endif
