#include "controller.h"
#include "dynamics.h"

/* One classical Runge-Kutta step. The same weights that add up the joint accelerations give the means of
 * every other rate over the step. */
static void step(impid_plant *plant, const double *torque, impid_plant_rates *mean) {
    static const double advance[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    const double dt = plant->step_s;
    const impid_plant_angles start = impid_plant_angles_of(plant->q);
    double w[2] = {plant->w[0], plant->w[1]};
    double a[2] = {0.0, 0.0};
    double turned[2] = {0.0, 0.0};
    impid_plant_rates sum = {{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};

    for (int stage = 0; stage < 4; stage++) {
        const double ds = advance[stage] * dt;
        const double dq[2] = {ds * w[0], ds * w[1]}; /* w is still that of the stage before */
        w[0] = plant->w[0] + ds * a[0];
        w[1] = plant->w[1] + ds * a[1];
        const impid_plant_angles angles = impid_plant_angles_near(&start, dq);
        impid_plant_rates rates;
        impid_plant_accelerate(plant, &angles, w, torque, &rates);
        for (int j = 0; j < 2; j++) {
            a[j] = rates.a[j];
            turned[j] += weight[stage] * w[j];
            sum.a[j] += weight[stage] * rates.a[j];
            sum.x[j] += weight[stage] * rates.x[j];
            sum.f[j] += weight[stage] * rates.f[j];
        }
    }
    for (int j = 0; j < 2; j++) {
        plant->q[j] += dt * turned[j];
        plant->w[j] += dt * sum.a[j];
    }
    *mean = sum;
}

void impid_plant_rest(impid_plant *plant, const double *q) {
    for (int j = 0; j < 2; j++) {
        plant->q[j] = q[j];
        plant->w[j] = 0.0;
        plant->velocity[j] = 0.0;
    }
    impid_plant_read_encoders(plant, plant->count);
}

void impid_plant_run(impid_plant *plant, size_t ticks, const double *reference, double *q, double *w,
                     double *acceleration, double *force, int32_t *count, double *torque) {
    for (size_t tick = 0; tick < ticks; tick++) {
        double *held = &torque[2u * tick];
        impid_plant_control(plant, &reference[4u * tick], held);
        count[2u * tick] = plant->count[0];
        count[2u * tick + 1u] = plant->count[1];
        for (size_t sub = 0; sub < IMPID_PLANT_SUBSTEPS; sub++) {
            const size_t row = 2u * (IMPID_PLANT_SUBSTEPS * tick + sub);
            impid_plant_rates mean;
            step(plant, held, &mean);
            for (size_t j = 0; j < 2u; j++) {
                q[row + j] = plant->q[j];
                w[row + j] = plant->w[j];
                acceleration[row + j] = mean.x[j];
                force[row + j] = mean.f[j];
            }
        }
    }
}
