#include "impid_selftest.h"

#include "impid_assert.h"
#include "impid_messages.h"

#include <string.h>

void impid_selftest_init(impid_selftest_t *selftest) {
    memset(selftest, 0, sizeof *selftest);
    selftest->verdict = IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_NOT_RUN_CHOICE;
}

void impid_selftest_begin(impid_selftest_t *selftest, uint16_t supply_mV) {
    impid_selftest_init(selftest);
    selftest->supply_mV = supply_mV;
    selftest->phase = IMPID_SELFTEST_BEFORE;
    selftest->verdict = IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_RUNNING_CHOICE;
}

bool impid_selftest_running(const impid_selftest_t *selftest) {
    return selftest->phase != IMPID_SELFTEST_IDLE;
}

static int32_t response_mV(const impid_selftest_t *selftest, uint32_t axis) {
    int64_t codes = (int64_t)selftest->during[axis] - (int64_t)selftest->before[axis];
    return (int32_t)(codes * selftest->supply_mV / (65536 * (int64_t)IMPID_SELFTEST_MEAN_SAMPLES));
}

static bool within_bounds(const impid_selftest_t *selftest, uint32_t axis) {
    uint64_t supply = selftest->supply_mV;
    uint64_t cube = supply * supply * supply;
    uint64_t cube_at_5V = 5000ull * 5000ull * 5000ull;
    int64_t low = (int64_t)(IMPID_SELFTEST_MIN_MV_AT_5V * cube / cube_at_5V);
    int64_t high = (int64_t)(IMPID_SELFTEST_MAX_MV_AT_5V * cube / cube_at_5V);
    return selftest->response_mV[axis] >= low && selftest->response_mV[axis] <= high;
}

static void judge(impid_selftest_t *selftest) {
    static const uint8_t verdicts[2][2] = {
        {IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_BOTH_CHOICE,
         IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_X_CHOICE},
        {IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_FAILED_Y_CHOICE,
         IMPID_MESSAGES_STATUS_HEALTH_SELF_TEST_PASSED_CHOICE},
    };
    for (uint32_t axis = 0; axis < 2u; axis++) {
        selftest->response_mV[axis] = response_mV(selftest, axis);
    }
    selftest->verdict = verdicts[within_bounds(selftest, 0)][within_bounds(selftest, 1)];
}

static void enter(impid_selftest_t *selftest, impid_selftest_phase_t phase) {
    selftest->phase = phase;
    selftest->samples = 0;
}

static bool averaged(impid_selftest_t *selftest, uint32_t sums[2], const impid_sample_t *sample) {
    IMPID_ASSERT(selftest->samples <= IMPID_SELFTEST_MEAN_SAMPLES); /* or the sums may overflow */
    sums[0] += sample->accel[0];
    sums[1] += sample->accel[1];
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
