/* Right-hand side of the equations of motion; used by the integrator alone. */
#ifndef IMPID_PLANT_DYNAMICS_H
#define IMPID_PLANT_DYNAMICS_H

#include "plant.h"

typedef struct {
    double s1, c1, s2, c2; /* sine and cosine of the two angles */
} impid_plant_angles;

typedef struct {
    double a[2]; /* joint accelerations, rad/s^2 */
    double x[2]; /* acceleration of the end-effector, m/s^2 */
    double f[2]; /* force of the load on the robot, N */
    double state[IMPID_EFFECTS_STATES];
} impid_plant_rates;

impid_plant_angles impid_plant_angles_of(const double *q);
/* Angles and speeds of the joints from those of the links. */
void impid_plant_joints(const impid_plant_robot *robot, const double *q, double *p);
void impid_plant_joint_speeds(const impid_plant_robot *robot, const double *w, double *u);
/* The angles base, turned on by the small amounts dq: costs no call of sin() or cos(). */
impid_plant_angles impid_plant_angles_near(const impid_plant_angles *base, const double *dq);
/* stage: w and the held torque are given, and with effects q, p, u, torque, input and states; x and v are
 * filled in. */
void impid_plant_accelerate(const impid_plant *plant, const impid_plant_angles *angles,
                            impid_effects_stage *stage, impid_plant_rates *out);

#endif
