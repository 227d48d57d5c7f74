/* The two-link robot, its joint controller and the load on its end-effector, in double precision.
 *
 * What it is for: the motion that the sensor board measures and that the robot's own log reports.
 *
 * Data flow: impid_plant_run() takes the reference of each controller tick and advances the world by
 * IMPID_PLANT_SUBSTEPS Runge-Kutta steps per tick. At each tick the controller reads the encoders, which
 * count in whole steps, and holds its torque until the next tick.
 *
 * Model, angles q of the links, [D] eqs. 1 and 11 to 13, with the sign of C's second row that energy demands:
 *     I(q) q'' + C(q, q') q' + F_r(q') = tau + J' F_ext
 *     F_ext = -(M x'' + B x' + K (x - x0)), the force of the load on the robot
 * Encoders, drives and friction know the joints' angles p: the same as q, or that of the second link against
 * the first.
 * q'' is linear in both, so robot and load are solved as one 2 by 2 system.
 *
 * Ownership: the caller owns the plant and all arrays. No heap, no globals. Cannot fail: what makes a
 * parameter meaningless is refused where the scenario is read.
 */
#ifndef IMPID_PLANT_H
#define IMPID_PLANT_H

#include "effects.h"

#include <stddef.h>
#include <stdint.h>

#define IMPID_PLANT_SUBSTEPS 8u

typedef struct {
    double alpha[5];  /* I: [0], [1], [2] kg m^2; viscous friction: [3], [4] N m s/rad */
    double length[2]; /* m */
    int32_t
        relative; /* joint angles p = (q1, q2 - q1 - 90 degrees): along the first link the second has none */
} impid_plant_robot;

/* All zero: nothing on the end-effector. Matrices row by row. */
typedef struct {
    double M[4];  /* kg */
    double B[4];  /* N s/m */
    double K[4];  /* N/m */
    double x0[2]; /* m, in the base frame */
} impid_plant_load;

typedef struct {
    double counts_per_rad[2]; /* sign: direction of counting */
    double zero_rad[2];       /* joint angle at count 0 */
    double once_per_turn[2];  /* eccentricity: amplitude, rad */
    double phase_rad[2];      /* of it */
    double shift_rad[2];      /* the reading is so much too high */
    double factor[2];         /* true angle over the declared one, both from count 0 */
} impid_plant_encoder;

typedef struct {
    int32_t at_tip;         /* 0: joint PD; 1: weak PD at the end-effector with a force on top, [P] eq. 2 */
    double kp[2];           /* N m/rad; N/m at the end-effector */
    double kd[2];           /* N m s/rad; N s/m */
    double velocity_weight; /* weight of the newest difference in the velocity estimate, 0 to 1 */
    double tick_s;          /* the controller's own idea of its period */
    double length[2];       /* of the links, as the controller believes, m */
} impid_plant_controller;

typedef struct {
    impid_plant_robot robot;
    impid_plant_load load;
    impid_plant_encoder encoder;
    impid_plant_controller controller;
    impid_effects effects;
    double step_s;      /* true length of one substep */
    double q[2];        /* rad */
    double w[2];        /* rad/s */
    double velocity[2]; /* the controller's estimate, rad/s */
    double angle[2];    /* what the controller read at the last tick, rad */
    int32_t count[2];   /* what the encoders showed then */
} impid_plant;

/* Puts the robot at rest at q, with the controller at rest too. */
void impid_plant_rest(impid_plant *plant, const double *q);

/* One row per substep s, which lasts from grid point s to s + 1: q and w at its end, acceleration of the
 * end-effector and force of the load on the robot as means over it (exact to the order of the
 * integration, also where the torque steps), and by how much the encoders then run ahead, rad. One row per
 * tick: the counts that were read at the tick, and the torque that is held from then on.
 *
 * reference: ticks rows of q1, q2 (rad), w1, w2 (rad/s); for the controller at the end-effector x, y (m) and
 * the force to add (N). input: ticks rows of IMPID_EFFECTS_INPUTS, held over the tick; NULL: all zero. */
void impid_plant_run(impid_plant *plant, size_t ticks, const double *reference, const double *input,
                     double *q, double *w, double *acceleration, double *force, double *crept, int32_t *count,
                     double *torque);

/* The kinetic energy of the robot and the mass on it, plus the energy of the load's springs, J; without that
 * of effects. */
double impid_plant_energy(const impid_plant *plant);

#endif
