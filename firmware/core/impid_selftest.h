/* The accelerometer's self-test: switch it on and see whether every output moves as its data sheet says.
 *
 * Data flow: fed with every sample while it runs; it averages 128 samples, drives the self-test, waits,
 * averages again, releases it and judges the difference of the means. The board must stand still meanwhile.
 * Bounds: the sensor's (impid_sensor.h). Of a ratiometric one they are in millivolts and go with the cube of
 * the supply, which is the converter's reference; of a digital one they are in thousandths of a g. Ownership:
 * the state belongs to the core. Timing: main loop, constant a sample; 336 ms in all. Can fail: the verdict
 * says so for each axis.
 */
#ifndef IMPID_SELFTEST_H
#define IMPID_SELFTEST_H

#include "impid_port.h"
#include "impid_ring.h"

#define IMPID_SELFTEST_MEAN_SAMPLES 128u
/* 40 ms: over a hundred time constants of the ADXL203's output filter and ten lengths of ours; 22 group
 * delays of the ADXL355's filter. */
#define IMPID_SELFTEST_SETTLE_SAMPLES 40u

typedef enum {
    IMPID_SELFTEST_IDLE,
    IMPID_SELFTEST_BEFORE,
    IMPID_SELFTEST_RISING,
    IMPID_SELFTEST_DURING,
    IMPID_SELFTEST_FALLING
} impid_selftest_phase_t;

typedef struct {
    const impid_sensor_t *sensor;
    impid_selftest_phase_t phase;
    uint32_t samples;                /* seen in this phase */
    uint32_t before[IMPID_AXES_MAX]; /* sums of 128 codes of 24 bits: half of the word */
    uint32_t during[IMPID_AXES_MAX];
    uint16_t supply_mV;                 /* of accelerometer and converter reference */
    int32_t response_m[IMPID_AXES_MAX]; /* mV, or thousandths of a g: as the sensor's limits */
    uint8_t verdict;                    /* as STATUS_HEALTH.self_test */
} impid_selftest_t;

void impid_selftest_init(impid_selftest_t *selftest, const impid_sensor_t *sensor);
/* supply_mV: of accelerometer and converter as it is now; of no matter to a digital sensor. */
void impid_selftest_begin(impid_selftest_t *selftest, uint16_t supply_mV);
/* Feeds one sample; true when that was the last and the verdict stands. */
bool impid_selftest_sample(impid_selftest_t *selftest, const impid_sample_t *sample,
                           const impid_port_t *port);
bool impid_selftest_running(const impid_selftest_t *selftest);

#endif
