#include "effects.h"

#include <math.h>

#define TURN 6.283185307179586

/* The part of d inside the play, within which no spring pulls. */
static double inside(double d, double half) {
    return d > half ? half : d < -half ? -half : d;
}

/* The load's motion `late_steps` ago, between the rows of the ring. */
static void remembered(const impid_effects_load *load, double steps, double *row) {
    const double whole = floor(steps);
    const double part = steps - whole;
    const int32_t rows = load->history_rows;
    const int32_t newer = (load->history_at - (int32_t)whole + rows) % rows;
    const int32_t older = (newer - 1 + rows) % rows;
    for (int i = 0; i < 4; i++) {
        row[i] = (1.0 - part) * load->history[4 * newer + i] + part * load->history[4 * older + i];
    }
}

double impid_effects_course(const impid_effects *e, double since) {
    const impid_effects_load *load = &e->load;
    const double time_s = e->time_s + since - load->course_from;
    if (load->course == IMPID_EFFECTS_RAMP) {
        return inside(time_s / load->course_span, 0.5);
    }
    if (load->course == IMPID_EFFECTS_JUMP) {
        return time_s < 0.0 ? -0.5 : 0.5;
    }
    return sin(TURN * time_s / load->course_span + load->course_phase);
}

void impid_effects_load_force(const impid_effects *e, const impid_effects_stage *s, const double *M,
                              const double *K, const double *d, double *force) {
    const impid_effects_load *load = &e->load;
    const double time_s = e->time_s + s->since - load->drift_from;
    /* The equilibrium wanders: K pulls towards another place. */
    const double shift[2] = {load->drift[0] * time_s + s->input[4], load->drift[1] * time_s + s->input[5]};
    const double slack[2] = {inside(d[0] - shift[0], load->play_half[0]),
                             inside(d[1] - shift[1], load->play_half[1])};
    const double radius2 = d[0] * d[0] + d[1] * d[1];
    for (int i = 0; i < 2; i++) {
        const double sweep = load->dry[i] != 0.0 ? s->since * s->v[i] / load->dry_width : 0.0;
        const double bend = (load->bend[i] + sweep) / (1.0 + fabs(sweep));
        force[i] = s->input[2 + i] + K[2 * i] * (shift[0] + slack[0]) + K[2 * i + 1] * (shift[1] + slack[1]) -
                   load->cubic[i] * d[i] * d[i] * d[i] - load->cubic_radial * radius2 * d[i] -
                   load->dry[i] * bend + M[2 * i] * e->gravity[0] + M[2 * i + 1] * e->gravity[1];
    }
    if (load->late_steps > 0.0) {
        double row[4];
        remembered(load, load->late_steps - s->since * load->steps_per_s, row);
        for (int i = 0; i < 2; i++) {
            force[i] -= load->late_k * row[i] + load->late_b * row[2 + i];
        }
    }
}

void impid_effects_load_step(impid_effects *e, const double *moved, const double *d, const double *v) {
    impid_effects_load *load = &e->load;
    for (int i = 0; i < 2; i++) {
        const double sweep = moved[i] / load->dry_width;
        load->bend[i] = (load->bend[i] + sweep) / (1.0 + fabs(sweep));
    }
    if (load->late_steps > 0.0) {
        load->history_at = (load->history_at + 1) % load->history_rows;
        double *row = &load->history[4 * load->history_at];
        row[0] = d[0];
        row[1] = d[1];
        row[2] = v[0];
        row[3] = v[1];
    }
}
