#include "impid_selftest.h"

#include "impid_assert.h"
#include "impid_messages.h"

#include <string.h>

void impid_selftest_init(impid_selftest_t *selftest, const impid_sensor_t *sensor) {
    memset(selftest, 0, sizeof *selftest);
    selftest->sensor = sensor;
    selftest->verdict = IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_NOT_RUN_CHOICE;
}

void impid_selftest_begin(impid_selftest_t *selftest, uint16_t supply_mV) {
    impid_selftest_init(selftest, selftest->sensor);
    selftest->supply_mV = supply_mV;
    selftest->phase = IMPID_SELFTEST_BEFORE;
    selftest->verdict = IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_RUNNING_CHOICE;
}

bool impid_selftest_running(const impid_selftest_t *selftest) {
    return selftest->phase != IMPID_SELFTEST_IDLE;
}

static int32_t response_m(const impid_selftest_t *selftest, uint32_t axis) {
    int64_t codes = (int64_t)selftest->during[axis] - (int64_t)selftest->before[axis];
    uint32_t full_scale = selftest->sensor->full_scale_m;
    int64_t scale = full_scale != 0u ? full_scale : selftest->supply_mV;
    return (int32_t)(codes * scale / ((1 << 24) * (int64_t)IMPID_SELFTEST_MEAN_SAMPLES));
}

static int64_t bound_m(const impid_selftest_t *selftest, uint32_t at_nominal) {
    uint64_t nominal = selftest->sensor->self_test_at_mV;
    uint64_t supply = nominal != 0u ? selftest->supply_mV : 1u;
    uint64_t cube_at_nominal = nominal != 0u ? nominal * nominal * nominal : 1u;
    return (int64_t)(at_nominal * (supply * supply * supply) / cube_at_nominal);
}

static bool within_bounds(const impid_selftest_t *selftest, uint32_t axis) {
    const impid_response_t *bounds = &selftest->sensor->self_test[axis];
    int64_t response = selftest->response_m[axis];
    return response >= bound_m(selftest, bounds->min_m) && response <= bound_m(selftest, bounds->max_m);
}

static void judge(impid_selftest_t *selftest) {
    /* By the axes that fail: 1 x, 2 y, 4 z. */
    static const uint8_t verdicts[8] = {
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_X_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Y_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_BOTH_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Z_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_X_Z_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Y_Z_CHOICE,
        IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_ALL_CHOICE,
    };
    uint32_t failed = 0;
    for (uint32_t axis = 0; axis < IMPID_AXES_MAX && axis < selftest->sensor->axes; axis++) {
        selftest->response_m[axis] = response_m(selftest, axis);
        failed |= within_bounds(selftest, axis) ? 0u : 1u << axis;
    }
    selftest->verdict = verdicts[failed];
}

static void enter(impid_selftest_t *selftest, impid_selftest_phase_t phase) {
    selftest->phase = phase;
    selftest->samples = 0;
}

static bool averaged(impid_selftest_t *selftest, uint32_t *sums, const impid_sample_t *sample) {
    IMPID_ASSERT(selftest->samples <= IMPID_SELFTEST_MEAN_SAMPLES); /* or the sums may overflow */
    for (uint32_t axis = 0; axis < IMPID_AXES_MAX && axis < selftest->sensor->axes; axis++) {
        sums[axis] += ((uint32_t)sample->accel[axis] << 8) | sample->fine[axis];
    }
    return selftest->samples == IMPID_SELFTEST_MEAN_SAMPLES;
}

bool impid_selftest_sample(impid_selftest_t *selftest, const impid_sample_t *sample,
                           const impid_port_t *port) {
    selftest->samples++;
    switch (selftest->phase) {
    case IMPID_SELFTEST_BEFORE:
        if (averaged(selftest, selftest->before, sample)) {
            port->self_test_pin(port->context, true);
            enter(selftest, IMPID_SELFTEST_RISING);
        }
        return false;
    case IMPID_SELFTEST_RISING:
        if (selftest->samples == IMPID_SELFTEST_SETTLE_SAMPLES) {
            enter(selftest, IMPID_SELFTEST_DURING);
        }
        return false;
    case IMPID_SELFTEST_DURING:
        if (averaged(selftest, selftest->during, sample)) {
            port->self_test_pin(port->context, false);
            enter(selftest, IMPID_SELFTEST_FALLING);
        }
        return false;
    case IMPID_SELFTEST_FALLING:
        /* The verdict waits until the outputs are back: a stream started on it is undisturbed. */
        if (selftest->samples == IMPID_SELFTEST_SETTLE_SAMPLES) {
            judge(selftest);
            enter(selftest, IMPID_SELFTEST_IDLE);
            return true;
        }
        return false;
    case IMPID_SELFTEST_IDLE:
    default:
        return false;
    }
}
