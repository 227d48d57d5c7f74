#include "controller.h"
#include "dynamics.h"

#include <math.h>

/* What the stages of a step share. */
static void begin(const double *input, impid_effects_stage *at) {
    for (size_t i = 0; input != NULL && i < IMPID_EFFECTS_INPUTS; i++) {
        at->input[i] = input[i];
    }
}

/* To the stage that lies ds after the beginning of the step. */
static void move_on(const impid_plant *plant, double ds, const double *dq, const impid_plant_rates *rates,
                    impid_effects_stage *at) {
    at->since = ds;
    for (int j = 0; j < 2; j++) {
        at->q[j] = plant->q[j] + dq[j];
    }
    for (size_t i = 0; i < IMPID_EFFECTS_STATES; i++) {
        at->state[i] = plant->effects.state[i] + ds * rates->state[i];
    }
    impid_plant_joints(&plant->robot, at->q, at->p);
    impid_plant_joint_speeds(&plant->robot, at->w, at->u);
    for (int j = 0; j < 2; j++) {
        at->torque[j] = impid_effects_arriving(&plant->effects, at, j);
    }
}

/* The end of a step: states that the effects carry on. */
static void finish(impid_plant *plant, const impid_effects_stage *at, const double *turned,
                   const impid_plant_rates *mean) {
    impid_effects *effects = &plant->effects;
    const impid_plant_angles n = impid_plant_angles_of(plant->q);
    const double l1 = plant->robot.length[0];
    const double l2 = plant->robot.length[1];
    const double v[2] = {-l1 * n.s1 * plant->w[0] + l2 * n.c2 * plant->w[1],
                         l1 * n.c1 * plant->w[0] + l2 * n.s2 * plant->w[1]};
    const double d[2] = {l1 * n.c1 + l2 * n.s2 - plant->load.x0[0],
                         l1 * n.s1 - l2 * n.c2 - plant->load.x0[1]};
    /* The load's bristles turn slowly enough for the end's velocity to stand for the mean's. */
    const double moved[2] = {plant->step_s * v[0], plant->step_s * v[1]};
    for (size_t i = 0; i < IMPID_EFFECTS_STATES; i++) {
        effects->state[i] += plant->step_s * mean->state[i];
    }
    double by[2];
    impid_plant_joint_speeds(&plant->robot, turned, by);
    impid_effects_friction_step(effects, by);
    impid_effects_drive_step(effects, at, by, plant->step_s);
    const double x[2] = {d[0] + plant->load.x0[0], d[1] + plant->load.x0[1]};
    impid_effects_tip_step(effects, x);
    impid_effects_load_step(effects, moved, d, v);
    effects->force = sqrt(mean->f[0] * mean->f[0] + mean->f[1] * mean->f[1]);
    effects->time_s += plant->step_s;
}

/* One classical Runge-Kutta step. The same weights that add up the joint accelerations give the means of
 * every other rate over the step. */
static void step(impid_plant *plant, const double *torque, const double *input, impid_plant_rates *mean) {
    static const double advance[4] = {0.0, 0.5, 0.5, 1.0};
    static const double weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    const double dt = plant->step_s;
    const impid_plant_angles start = impid_plant_angles_of(plant->q);
    impid_effects *effects = &plant->effects;
    impid_effects_stage at = {.w = {plant->w[0], plant->w[1]}, .held = {torque[0], torque[1]}};
    double turned[2] = {0.0, 0.0};
    impid_plant_rates rates = {.a = {0.0, 0.0}};
    impid_plant_rates sum = {.a = {0.0, 0.0}};
    if (effects->present) {
        begin(input, &at);
    }

    for (int stage = 0; stage < 4; stage++) {
        const double ds = advance[stage] * dt;
        const double dq[2] = {ds * at.w[0], ds * at.w[1]}; /* w is still that of the stage before */
        at.w[0] = plant->w[0] + ds * rates.a[0];
        at.w[1] = plant->w[1] + ds * rates.a[1];
        if (effects->present) {
            move_on(plant, ds, dq, &rates, &at);
        }
        const impid_plant_angles angles = impid_plant_angles_near(&start, dq);
        impid_plant_accelerate(plant, &angles, &at, &rates);
        for (size_t i = 0; effects->present && i < IMPID_EFFECTS_STATES; i++) {
            sum.state[i] += weight[stage] * rates.state[i];
        }
        for (int j = 0; j < 2; j++) {
            turned[j] += weight[stage] * at.w[j];
            sum.a[j] += weight[stage] * rates.a[j];
            sum.x[j] += weight[stage] * rates.x[j];
            sum.f[j] += weight[stage] * rates.f[j];
        }
    }
    for (int j = 0; j < 2; j++) {
        plant->q[j] += dt * turned[j];
        plant->w[j] += dt * sum.a[j];
        turned[j] *= dt;
    }
    if (effects->present) {
        finish(plant, &at, turned, &sum);
    }
    *mean = sum;
}

void impid_plant_rest(impid_plant *plant, const double *q) {
    for (int j = 0; j < 2; j++) {
        plant->q[j] = q[j];
        plant->w[j] = 0.0;
        plant->velocity[j] = 0.0;
    }
    double p[2];
    impid_plant_joints(&plant->robot, q, p);
    for (int j = 0; j < 2; j++) {
        plant->effects.state[j] = p[j];
        plant->effects.state[4 + j] = p[j];
    }
    const impid_plant_angles n = impid_plant_angles_of(q);
    plant->effects.place[0] = plant->robot.length[0] * n.c1 + plant->robot.length[1] * n.s2;
    plant->effects.place[1] = plant->robot.length[0] * n.s1 - plant->robot.length[1] * n.c2;
    impid_plant_read_encoders(plant, plant->count);
    impid_plant_rest_control(plant);
}

void impid_plant_run(impid_plant *plant, size_t ticks, const double *reference, const double *input,
                     double *q, double *w, double *acceleration, double *force, double *crept, int32_t *count,
                     double *torque) {
    for (size_t tick = 0; tick < ticks; tick++) {
        double *held = &torque[2u * tick];
        const double *now = input == NULL ? NULL : &input[IMPID_EFFECTS_INPUTS * tick];
        impid_plant_control(plant, &reference[4u * tick], held);
        count[2u * tick] = plant->count[0];
        count[2u * tick + 1u] = plant->count[1];
        for (size_t sub = 0; sub < IMPID_PLANT_SUBSTEPS; sub++) {
            const size_t row = 2u * (IMPID_PLANT_SUBSTEPS * tick + sub);
            impid_plant_rates mean;
            step(plant, held, now, &mean);
            for (size_t j = 0; j < 2u; j++) {
                q[row + j] = plant->q[j];
                w[row + j] = plant->w[j];
                acceleration[row + j] = mean.x[j];
                force[row + j] = mean.f[j];
                crept[row + j] = plant->effects.crept[j];
            }
        }
    }
}
