/* The accelerometer's self-test: drive its ST pin and see whether both outputs move as the data sheet says.
 *
 * Data flow: fed with every sample while it runs; it averages 128 samples, drives the pin, waits, averages
 * again, releases the pin and judges the difference of the means. The board must stand still meanwhile.
 * Bounds: ADXL203 data sheet, output change 400 mV (min), 750 mV (typ), 1100 mV (max) at 5 V; in volts the
 * response goes with the cube of the supply (same sheet, operation at other voltages), and the converter's
 * reference is the supply.
 * Ownership: the state belongs to the core. Timing: main loop, constant a sample; 336 ms in all.
 * Can fail: the verdict says so for each axis.
 */
#ifndef IMPID_SELFTEST_H
#define IMPID_SELFTEST_H

#include "impid_port.h"
#include "impid_ring.h"

#define IMPID_SELFTEST_MIN_MV_AT_5V 400u
#define IMPID_SELFTEST_MAX_MV_AT_5V 1100u
#define IMPID_SELFTEST_MEAN_SAMPLES 128u
/* 40 ms: over a hundred time constants of the 500 Hz output filter, and ten lengths of ours. */
#define IMPID_SELFTEST_SETTLE_SAMPLES 40u

typedef enum {
    IMPID_SELFTEST_IDLE,
    IMPID_SELFTEST_BEFORE,
    IMPID_SELFTEST_RISING,
    IMPID_SELFTEST_DURING,
    IMPID_SELFTEST_FALLING
} impid_selftest_phase_t;

typedef struct {
    impid_selftest_phase_t phase;
    uint32_t samples;   /* seen in this phase */
    uint32_t before[2]; /* sums of codes */
    uint32_t during[2];
    uint16_t supply_mV; /* of accelerometer and converter reference */
    int32_t response_mV[2];
    uint8_t verdict; /* as STATUS_HEALTH.self_test */
} impid_selftest_t;

void impid_selftest_init(impid_selftest_t *selftest);
/* supply_mV: of accelerometer and converter as it is now. */
void impid_selftest_begin(impid_selftest_t *selftest, uint16_t supply_mV);
/* Feeds one sample; true when that was the last and the verdict stands. */
bool impid_selftest_sample(impid_selftest_t *selftest, const impid_sample_t *sample,
                           const impid_port_t *port);
bool impid_selftest_running(const impid_selftest_t *selftest);

#endif
