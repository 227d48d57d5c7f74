#include "dynamics.h"

#include <math.h>

/* Beyond this turn within one step the series below would lose digits. At 8 kHz it is 160 rad/s. */
#define SMALL_TURN_RAD 0.02
#define QUARTER_TURN   1.5707963267948966

typedef struct {
    double s, c;
} turn;

impid_plant_angles impid_plant_angles_of(const double *q) {
    const impid_plant_angles angles = {sin(q[0]), cos(q[0]), sin(q[1]), cos(q[1])};
    return angles;
}

/* The first neglected terms, d^7/5040 and d^8/40320, stay below the rounding of a double. */
static turn small_turn(double d) {
    const double d2 = d * d;
    turn t;
    if (fabs(d) > SMALL_TURN_RAD) {
        t.s = sin(d);
        t.c = cos(d);
    } else {
        t.s = d * (1.0 - d2 * (1.0 / 6.0) * (1.0 - d2 * (1.0 / 20.0)));
        t.c = 1.0 - d2 * 0.5 * (1.0 - d2 * (1.0 / 12.0) * (1.0 - d2 * (1.0 / 30.0)));
    }
    return t;
}

impid_plant_angles impid_plant_angles_near(const impid_plant_angles *base, const double *dq) {
    const turn t1 = small_turn(dq[0]);
    const turn t2 = small_turn(dq[1]);
    const impid_plant_angles angles = {
        base->s1 * t1.c + base->c1 * t1.s,
        base->c1 * t1.c - base->s1 * t1.s,
        base->s2 * t2.c + base->c2 * t2.s,
        base->c2 * t2.c - base->s2 * t2.s,
    };
    return angles;
}

/* What the hidden effects add: torques at the joints, torques on the links (r), forces of the load (f), rates
 * of their states. */
static void add_effects(const impid_plant *plant, const impid_plant_load *now,
                        const impid_effects_stage *stage, const double *d, double *joint, double *r,
                        double *f, double *tip, impid_plant_rates *out) {
    const impid_effects *e = &plant->effects;
    double load[2];
    impid_effects_tip(e, stage, tip, r);
    impid_effects_load_force(e, stage, now->M, now->K, d, load);
    for (int j = 0; j < 2; j++) {
        f[j] += load[j];
        joint[j] = impid_effects_drive_torque(e, stage, j, out->state) -
                   impid_effects_friction_torque(e, stage, j) - impid_effects_angle_torque(e, stage, j);
    }
}

/* The load as it is at this instant. */
static impid_plant_load load_now(const impid_plant *plant, double since) {
    const impid_effects_load *more = &plant->effects.load;
    impid_plant_load now = plant->load;
    if (plant->effects.present && more->course != IMPID_EFFECTS_CONSTANT) {
        const double course = impid_effects_course(&plant->effects, since);
        for (int i = 0; i < 4; i++) {
            now.M[i] += course * more->more_M[i];
            now.B[i] += course * more->more_B[i];
            now.K[i] += course * more->more_K[i];
        }
    }
    return now;
}

void impid_plant_joints(const impid_plant_robot *robot, const double *q, double *p) {
    p[0] = q[0];
    p[1] = robot->relative ? q[1] - q[0] - QUARTER_TURN : q[1];
}

void impid_plant_joint_speeds(const impid_plant_robot *robot, const double *w, double *u) {
    u[0] = w[0];
    u[1] = robot->relative ? w[1] - w[0] : w[1];
}

void impid_plant_accelerate(const impid_plant *plant, const impid_plant_angles *angles,
                            impid_effects_stage *stage, impid_plant_rates *out) {
    const double *w = stage->w;
    const double *alpha = plant->robot.alpha;
    const double l1 = plant->robot.length[0];
    const double l2 = plant->robot.length[1];
    const impid_plant_load now = load_now(plant, stage->since);
    const impid_plant_load *load = &now;
    const double *M = load->M;
    const double *B = load->B;
    const double *K = load->K;

    /* J and J' q' of x = l1 cos q1 + l2 sin q2, y = l1 sin q1 - l2 cos q2. */
    const double J00 = -l1 * angles->s1;
    const double J01 = l2 * angles->c2;
    const double J10 = l1 * angles->c1;
    const double J11 = l2 * angles->s2;
    const double w1w1 = w[0] * w[0];
    const double w2w2 = w[1] * w[1];
    const double Jw_x = -J10 * w1w1 - J11 * w2w2;
    const double Jw_y = J00 * w1w1 + J01 * w2w2;

    /* Force of the load, without the part that comes from q''. */
    const double dx = J10 - load->x0[0] + J11;
    const double dy = -J00 - load->x0[1] - J01;
    const double vx = J00 * w[0] + J01 * w[1];
    const double vy = J10 * w[0] + J11 * w[1];
    double f[2];
    f[0] = -(M[0] * Jw_x + M[1] * Jw_y + B[0] * vx + B[1] * vy + K[0] * dx + K[1] * dy);
    f[1] = -(M[2] * Jw_x + M[3] * Jw_y + B[2] * vx + B[3] * vy + K[2] * dx + K[3] * dy);

    double drive[2] = {0.0, 0.0}; /* on the links; what acts at the joints comes below */
    double joint[2] = {stage->held[0], stage->held[1]};
    double tip[2] = {0.0, 0.0};
    if (plant->effects.present) {
        const double d[2] = {dx, dy};
        stage->x[0] = dx + load->x0[0];
        stage->x[1] = dy + load->x0[1];
        stage->v[0] = vx;
        stage->v[1] = vy;
        add_effects(plant, load, stage, d, joint, drive, f, tip, out);
    }

    double u[2];
    impid_plant_joint_speeds(&plant->robot, w, u);
    joint[0] -= alpha[3] * u[0];
    joint[1] -= alpha[4] * u[1];
    /* A drive between the links pushes the first one back. */
    drive[0] += plant->robot.relative ? joint[0] - joint[1] : joint[0];
    drive[1] += joint[1];

    /* I + J' M J, [D] eq. 11 and the load's mass seen from the joints. */
    const double sin_difference = angles->s1 * angles->c2 - angles->c1 * angles->s2;
    const double cos_difference = angles->c1 * angles->c2 + angles->s1 * angles->s2;
    const double h = -0.5 * alpha[1] * sin_difference + plant->effects.inertia12;
    const double MJ00 = M[0] * J00 + M[1] * J10;
    const double MJ01 = M[0] * J01 + M[1] * J11;
    const double MJ10 = M[2] * J00 + M[3] * J10;
    const double MJ11 = M[2] * J01 + M[3] * J11;
    const double A00 = alpha[0] + J00 * MJ00 + J10 * MJ10;
    const double A01 = h + J00 * MJ01 + J10 * MJ11;
    const double A10 = h + J01 * MJ00 + J11 * MJ10;
    const double A11 = alpha[2] + J01 * MJ01 + J11 * MJ11;

    /* tau - C q' - F_r + J' f, [D] eqs. 12 (second row with the sign that conserves energy) and 13. */
    const double c = 0.5 * alpha[1] * cos_difference;
    const double sx = f[0] + tip[0];
    const double sy = f[1] + tip[1];
    const double r0 = drive[0] - c * w2w2 + J00 * sx + J10 * sy;
    const double r1 = drive[1] + c * w1w1 + J01 * sx + J11 * sy;

    const double inverse = 1.0 / (A00 * A11 - A01 * A10);
    const double a0 = (A11 * r0 - A01 * r1) * inverse;
    const double a1 = (A00 * r1 - A10 * r0) * inverse;

    out->a[0] = a0;
    out->a[1] = a1;
    out->x[0] = J00 * a0 + J01 * a1 + Jw_x;
    out->x[1] = J10 * a0 + J11 * a1 + Jw_y;
    out->f[0] = f[0] - MJ00 * a0 - MJ01 * a1;
    out->f[1] = f[1] - MJ10 * a0 - MJ11 * a1;
}

double impid_plant_energy(const impid_plant *plant) {
    const double *alpha = plant->robot.alpha;
    const double *w = plant->w;
    const double *M = plant->load.M;
    const double *K = plant->load.K;
    const double l1 = plant->robot.length[0];
    const double l2 = plant->robot.length[1];
    const impid_plant_angles n = impid_plant_angles_of(plant->q);
    const double vx = -l1 * n.s1 * w[0] + l2 * n.c2 * w[1];
    const double vy = l1 * n.c1 * w[0] + l2 * n.s2 * w[1];
    const double dx = l1 * n.c1 + l2 * n.s2 - plant->load.x0[0];
    const double dy = l1 * n.s1 - l2 * n.c2 - plant->load.x0[1];
    const double h = -0.5 * alpha[1] * (n.s1 * n.c2 - n.c1 * n.s2) + plant->effects.inertia12;
    const double robot = 0.5 * (alpha[0] * w[0] * w[0] + alpha[2] * w[1] * w[1]) + h * w[0] * w[1];
    const double mass = 0.5 * (M[0] * vx * vx + (M[1] + M[2]) * vx * vy + M[3] * vy * vy);
    const double spring = 0.5 * (K[0] * dx * dx + (K[1] + K[2]) * dx * dy + K[3] * dy * dy);
    return robot + mass + spring;
}
