/* What the core knows of an accelerometer. All in which one differs from another stands in this struct: how
 * many axes, how wide its readings are and what they mean, how often it is read, by how much it is late, and
 * what its self-test must do.
 *
 * Data flow: the port hands the sensor over in impid_core_config_t; sampler, stream, self-test and INFO read
 * it. Ownership: constant data, of the core or of the port. Timing: none. Can fail: no.
 *
 * Readings are unsigned: 0 is the lower rail, `reading_max` the upper one. A sample's code is the reading,
 * filtered or not, moved to the top of 16 bits (ACCEL) or of 24 (ACCEL with ACCEL_FINE): mid-scale is zero g.
 */
#ifndef IMPID_SENSOR_H
#define IMPID_SENSOR_H

#include <stdbool.h>
#include <stdint.h>

/* What a build has room for. A board that has two axes says so and saves a kilobyte of RAM. */
#ifndef IMPID_AXES_MAX
#define IMPID_AXES_MAX 3u
#endif
#define IMPID_DELAY_TICKS_MAX 2u

/* As INFO SENSOR. */
#define IMPID_SENSOR_ADXL203 1u
#define IMPID_SENSOR_ADXL355 2u

typedef struct {
    uint16_t min_m; /* thousandths of the unit of full_scale_m */
    uint16_t max_m;
} impid_response_t;

typedef struct {
    uint8_t id;              /* IMPID_SENSOR_* */
    uint8_t axes;            /* 2, or 3 */
    uint8_t readings;        /* of each axis in a tick: 8 go through the decimator, 1 is the sample */
    uint8_t reading_bits;    /* of one reading: at most 16 if there are 8, at most 24 if there is 1 */
    uint32_t reading_max;    /* upper rail */
    bool wide;               /* codes of 24 bits, ACCEL_FINE on the wire; else of 16 */
    uint8_t delay_ticks;     /* by which the sampler takes encoders, time and flags from the past */
    uint16_t group_delay_us; /* from motion to tick, of sensor and filter together */
    uint16_t full_scale_m;   /* thousandths of a g at full scale; 0: millivolts, the supply's, ratiometric */
    impid_response_t self_test[3];
    uint16_t self_test_at_mV; /* supply for which those hold, going with its cube; 0: with any */
} impid_sensor_t;

/* Analog output, 500 Hz by 10 nF, on a 12-bit converter whose reference is the supply. */
extern const impid_sensor_t impid_adxl203;
/* The same on a converter that adds 16 conversions of 12 bits up. */
extern const impid_sensor_t impid_adxl203_oversampled;
#if IMPID_AXES_MAX > 2u
/* Digital output, 20 bits, read once a tick. */
extern const impid_sensor_t impid_adxl355;
#endif

#endif
