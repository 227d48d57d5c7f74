#include "effects.h"

#include <math.h>

#define TURN 6.283185307179586

/* How strongly joint j rubs at this place, speed and time, N m. Never negative: friction does not drive. */
static double level_at(const impid_effects *e, const double *q, double w, int j, double time_s) {
    const impid_effects_friction *f = &e->friction[j];
    double level = f->level[w < 0.0];
    if (f->stribeck != 0.0) {
        const double ratio = w / f->stribeck_speed;
        level += f->stribeck * exp(-ratio * ratio);
    }
    if (f->warm_level != 0.0) {
        level += f->warm_level * exp(-time_s / f->warm_time);
    }
    level += f->per_force * e->force;
    for (int32_t i = 0; i < e->terms; i++) {
        const impid_effects_term *term = &e->term[i];
        if (term->kind == IMPID_EFFECTS_DRY_RIPPLE && term->joint == j) {
            level += term->size * sin(TURN * term->a * q[j] + term->b);
        }
    }
    return level > 0.0 ? level : 0.0;
}

static double viscous_at(const impid_effects *e, const double *q, double w, int j, double time_s) {
    const impid_effects_friction *f = &e->friction[j];
    double viscous = f->viscous[w < 0.0];
    if (f->warm_viscous != 0.0) {
        viscous += f->warm_viscous * exp(-time_s / f->warm_time);
    }
    for (int32_t i = 0; i < e->terms; i++) {
        const impid_effects_term *term = &e->term[i];
        if (term->kind == IMPID_EFFECTS_VISCOUS_RIPPLE && term->joint == j) {
            viscous += term->size * sin(TURN * term->a * q[j] + term->b);
        }
    }
    return viscous;
}

/* Implicit Euler of bend' = (w - |w| bend) / presliding: sliding drives it to the sign of the speed. */
static double bent(double bend, double turned, double presliding) {
    const double by = turned / presliding;
    return (bend + by) / (1.0 + fabs(by));
}

double impid_effects_friction_torque(const impid_effects *e, const impid_effects_stage *s, int j) {
    const impid_effects_friction *f = &e->friction[j];
    const double w = s->w[j];
    const double time_s = e->time_s + s->since;
    const double bend = bent(f->bend, s->since * w, f->presliding);
    return level_at(e, s->q, w, j, time_s) * bend +
           (viscous_at(e, s->q, w, j, time_s) + f->quadratic * fabs(w)) * w;
}

void impid_effects_friction_step(impid_effects *e, const double *turned) {
    for (int j = 0; j < 2; j++) {
        impid_effects_friction *f = &e->friction[j];
        f->bend = bent(f->bend, turned[j], f->presliding);
    }
}
