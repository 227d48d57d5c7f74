#include "controller.h"

#include <math.h>

void impid_plant_read_encoders(const impid_plant *plant, int32_t *count) {
    for (int j = 0; j < 2; j++) {
        const double angle = plant->q[j] - plant->encoder.zero_rad[j];
        count[j] = (int32_t)floor(angle * plant->encoder.counts_per_rad[j] + 0.5);
    }
}

void impid_plant_control(impid_plant *plant, const double *reference, double *torque) {
    const impid_plant_controller *controller = &plant->controller;
    int32_t count[2];
    impid_plant_read_encoders(plant, count);
    for (int j = 0; j < 2; j++) {
        const double scale = plant->encoder.counts_per_rad[j];
        const double q = plant->encoder.zero_rad[j] + count[j] / scale;
        const double difference = (count[j] - plant->count[j]) / (scale * controller->tick_s);
        plant->velocity[j] += controller->velocity_weight * (difference - plant->velocity[j]);
        plant->count[j] = count[j];
        torque[j] = controller->kp[j] * (reference[j] - q) +
                    controller->kd[j] * (reference[2 + j] - plant->velocity[j]);
    }
}
