#include "effects.h"

#include <math.h>

void impid_effects_tip(const impid_effects *e, const impid_effects_stage *s, double *force, double *torque) {
    const double *K = e->tip_stiffness;
    const double *B = e->tip_damping;
    const double *g = e->gravity;
    for (int i = 0; i < 2; i++) {
        force[i] = e->tip_pull[i] - K[2 * i] * s->x[0] - K[2 * i + 1] * s->x[1] - B[2 * i] * s->v[0] -
                   B[2 * i + 1] * s->v[1] - impid_effects_slip_pull(&e->tip_slip[i], s->x[i] - e->place[i]);
    }
    /* The links point along (cos q1, sin q1) and (sin q2, -cos q2). */
    torque[0] = e->moment[0] * (-sin(s->q[0]) * g[0] + cos(s->q[0]) * g[1]);
    torque[1] = e->moment[1] * (cos(s->q[1]) * g[0] + sin(s->q[1]) * g[1]);
    for (int j = 0; j < 2; j++) {
        torque[j] -= e->weight_sin[j] * sin(s->q[j]) + e->weight_cos[j] * cos(s->q[j]);
    }
}

void impid_effects_tip_step(impid_effects *e, const double *x) {
    for (int i = 0; i < 2; i++) {
        impid_effects_slip_step(&e->tip_slip[i], x[i] - e->place[i]);
        e->place[i] = x[i];
    }
}
