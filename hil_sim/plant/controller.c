#include "controller.h"
#include "dynamics.h"

#include <math.h>

#define QUARTER_TURN 1.5707963267948966

/* What the encoder of joint j shows at this angle: a disc off its centre errs once per turn. */
static int32_t count_at(const impid_plant_encoder *encoder, int j, double angle) {
    const double shown =
        angle + encoder->shift_rad[j] + encoder->once_per_turn[j] * sin(angle + encoder->phase_rad[j]);
    const double turned = (shown - encoder->zero_rad[j]) / encoder->factor[j];
    return (int32_t)floor(turned * encoder->counts_per_rad[j] + 0.5);
}

void impid_plant_read_encoders(const impid_plant *plant, int32_t *count) {
    double p[2];
    impid_plant_joints(&plant->robot, plant->q, p);
    for (int j = 0; j < 2; j++) {
        count[j] = count_at(&plant->encoder, j, p[j] + plant->effects.crept[j]);
    }
}

/* The angles that the loop is closed on. Where the transmission gives way, a drive watches its motor: the
 * encoders at the joints are then for the log alone. */
static void read_angles(const impid_plant *plant, double *angle) {
    for (int j = 0; j < 2; j++) {
        int32_t count = plant->count[j];
        if (plant->effects.present && plant->effects.motor[j].inertia > 0.0) {
            count = count_at(&plant->encoder, j, plant->effects.state[j]);
        }
        angle[j] = plant->encoder.zero_rad[j] + count / plant->encoder.counts_per_rad[j];
    }
}

void impid_plant_rest_control(impid_plant *plant) {
    read_angles(plant, plant->angle);
}

static void joint_torque(const impid_plant *plant, const double *reference, double *torque) {
    const impid_plant_controller *controller = &plant->controller;
    for (int j = 0; j < 2; j++) {
        torque[j] = controller->kp[j] * (reference[j] - plant->angle[j]) +
                    controller->kd[j] * (reference[2 + j] - plant->velocity[j]);
    }
}

/* F_c = F + kp (d_des - d) - kd v, [P] eq. 2 with v for the velocity, through J'. */
static void tip_torque(const impid_plant *plant, const double *reference, double *torque) {
    const impid_plant_controller *controller = &plant->controller;
    const int32_t relative = plant->robot.relative;
    const double q[2] = {plant->angle[0],
                         relative ? plant->angle[0] + plant->angle[1] + QUARTER_TURN : plant->angle[1]};
    const double w[2] = {plant->velocity[0],
                         relative ? plant->velocity[0] + plant->velocity[1] : plant->velocity[1]};
    const double *length = controller->length;
    const double J[4] = {-length[0] * sin(q[0]), length[1] * cos(q[1]), length[0] * cos(q[0]),
                         length[1] * sin(q[1])};
    const double x[2] = {J[2] + J[3], -J[0] - J[1]};
    double force[2];
    for (int i = 0; i < 2; i++) {
        const double v = J[2 * i] * w[0] + J[2 * i + 1] * w[1];
        force[i] = reference[2 + i] + controller->kp[i] * (reference[i] - x[i]) - controller->kd[i] * v;
    }
    torque[0] = J[0] * force[0] + J[2] * force[1];
    torque[1] = J[1] * force[0] + J[3] * force[1];
    torque[0] += relative ? torque[1] : 0.0;
}

void impid_plant_control(impid_plant *plant, const double *reference, double *torque) {
    const impid_plant_controller *controller = &plant->controller;
    double angle[2];
    impid_plant_read_encoders(plant, plant->count);
    read_angles(plant, angle);
    for (int j = 0; j < 2; j++) {
        const double difference = (angle[j] - plant->angle[j]) / controller->tick_s;
        plant->velocity[j] += controller->velocity_weight * (difference - plant->velocity[j]);
        plant->angle[j] = angle[j];
    }
    if (controller->at_tip) {
        tip_torque(plant, reference, torque);
    } else {
        joint_torque(plant, reference, torque);
    }
}
