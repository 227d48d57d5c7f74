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
            torque += term->size * (s->p[j] - term->a);
        } else if (term->kind == IMPID_EFFECTS_RIPPLE) {
            torque += term->size * sin(TURN * term->a * s->p[j] + term->b);
        } else if (term->kind == IMPID_EFFECTS_BUMP) {
            const double off = (s->p[j] - term->a) / term->b;
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
        const double passed = through(motor, s->state[j], s->state[2 + j], s->p[j], s->u[j]);
        rate[j] = s->state[2 + j];
        rate[2 + j] = (torque - passed) / motor->inertia;
        torque = passed;
    }
    const impid_effects_coupled *resonator = &e->resonator[j];
    if (resonator->inertia > 0.0) {
        const double back = through(resonator, s->state[4 + j], s->state[6 + j], s->p[j], s->u[j]);
        rate[4 + j] = s->state[6 + j];
        rate[6 + j] = -back / resonator->inertia;
        torque += back;
    }
    return torque;
}

double impid_effects_arriving(const impid_effects *e, const impid_effects_stage *s, int j) {
    double torque = s->held[j];
    if (e->lag_s[j] > 0.0) {
        torque += (e->lagged[j] - torque) * exp(-s->since / e->lag_s[j]);
    }
    double gain = e->gain[j];
    if (e->fade[j] != 0.0) {
        const double warm_s = fmax(0.0, e->time_s + s->since + e->fade_from);
        gain *= 1.0 + e->fade[j] * expm1(-warm_s / e->fade_s);
    }
    return gain * torque - e->offset[j] + s->input[j];
}

void impid_effects_drive_step(impid_effects *e, const impid_effects_stage *s, const double *turned,
                              double dt) {
    for (int j = 0; j < 2; j++) {
        const double behind = e->lag_s[j] > 0.0 ? exp(-dt / e->lag_s[j]) : 0.0;
        e->lagged[j] = s->held[j] + (e->lagged[j] - s->held[j]) * behind;
        e->crept[j] += e->creep[j] * s->torque[j] * fabs(turned[j]);
    }
}
