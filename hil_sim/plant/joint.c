#include "effects.h"

#include <math.h>

#define TURN 6.283185307179586

double impid_effects_angle_torque(const impid_effects *e, const impid_effects_stage *s, int j) {
    double torque = 0.0;
    for (int32_t i = 0; i < e->terms; i++) {
        const impid_effects_term *term = &e->term[i];
        if (term->joint != j) {
            continue;
        }
        if (term->kind == IMPID_EFFECTS_SPRING) {
            torque += term->size * (s->q[j] - term->a);
        } else if (term->kind == IMPID_EFFECTS_RIPPLE) {
            torque += term->size * sin(TURN * term->a * s->q[j] + term->b);
        } else if (term->kind == IMPID_EFFECTS_BUMP) {
            const double off = (s->q[j] - term->a) / term->b;
            torque += term->size * exp(-0.5 * off * off);
        }
    }
    return torque;
}

static double through(const impid_effects_coupled *c, double angle, double speed, double q, double w) {
    return c->stiffness * (angle - q) + c->damping * (speed - w);
}

double impid_effects_drive_torque(const impid_effects *e, const impid_effects_stage *s, int j, double *rate) {
    double torque = s->torque[j];
    const impid_effects_coupled *motor = &e->motor[j];
    if (motor->inertia > 0.0) {
        const double passed = through(motor, s->state[j], s->state[2 + j], s->q[j], s->w[j]);
        rate[j] = s->state[2 + j];
        rate[2 + j] = (torque - passed) / motor->inertia;
        torque = passed;
    }
    const impid_effects_coupled *resonator = &e->resonator[j];
    if (resonator->inertia > 0.0) {
        const double back = through(resonator, s->state[4 + j], s->state[6 + j], s->q[j], s->w[j]);
        rate[4 + j] = s->state[6 + j];
        rate[6 + j] = -back / resonator->inertia;
        torque += back;
    }
    return torque;
}
