#include "effects.h"

#include <math.h>
#include <stddef.h>

#define TURN 6.283185307179586

/* How strongly joint j rubs at this place, speed and time, N m. Never negative: friction does not drive. */
static double level_at(const impid_effects *e, const impid_effects_stage *s, int j, double time_s) {
    const double *q = s->p;
    const double w = s->u[j];
    const impid_effects_friction *f = &e->friction[j];
    double level = f->level[w < 0.0];
    if (f->stribeck != 0.0) {
        const double ratio = w / f->stribeck_speed;
        level += f->stribeck * exp(-ratio * ratio);
    }
    if (f->warm_level != 0.0) {
        level += f->warm_level * exp(-time_s / f->warm_time);
    }
    level += f->per_force * e->force + f->per_torque * fabs(s->torque[j]);
    for (int32_t i = 0; i < e->terms; i++) {
        const impid_effects_term *term = &e->term[i];
        if (term->kind == IMPID_EFFECTS_DRY_RIPPLE && term->joint == j) {
            level += term->size * sin(TURN * term->a * q[j] + term->b);
        }
    }
    return level > 0.0 ? level : 0.0;
}

/* The bristle of Dahl's law without the help of a small step: exact while the speed keeps its sign. */
static double bent_far(double bend, double turned, double width) {
    const double towards = turned < 0.0 ? -1.0 : 1.0;
    return towards + (bend - towards) * exp(-fabs(turned) / width);
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
    const double w = s->u[j];
    const double time_s = e->time_s + s->since;
    const double bend = bent(f->bend, s->since * w, f->presliding);
    double torque = level_at(e, s, j, time_s) * bend +
                    (viscous_at(e, s->p, w, j, time_s) + f->quadratic * fabs(w)) * w +
                    impid_effects_slip_pull(&f->slip, s->since * w);
    if (f->spring_level != 0.0) {
        torque += f->spring_level * bent_far(f->spring_bend, s->since * w, f->spring_width);
    }
    return torque;
}

static double stretched(double at, double limit) {
    return at > limit ? limit : at < -limit ? -limit : at;
}

double impid_effects_slip_pull(const impid_effects_slip *slip, double moved) {
    double pull = 0.0;
    for (size_t i = 0; i < IMPID_EFFECTS_SLIPS; i++) {
        if (slip->level[i] != 0.0) {
            pull += slip->level[i] * stretched(slip->at[i] + moved, slip->limit[i]) / slip->limit[i];
        }
    }
    return pull;
}

void impid_effects_slip_step(impid_effects_slip *slip, double moved) {
    for (size_t i = 0; i < IMPID_EFFECTS_SLIPS; i++) {
        if (slip->level[i] != 0.0) {
            slip->at[i] = stretched(slip->at[i] + moved, slip->limit[i]);
        }
    }
}

void impid_effects_friction_step(impid_effects *e, const double *turned) {
    for (int j = 0; j < 2; j++) {
        impid_effects_friction *f = &e->friction[j];
        f->bend = bent(f->bend, turned[j], f->presliding);
        if (f->spring_level != 0.0) {
            f->spring_bend = bent_far(f->spring_bend, turned[j], f->spring_width);
        }
        impid_effects_slip_step(&f->slip, turned[j]);
    }
}
