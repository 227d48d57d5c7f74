/* The robot's joint controller and the encoders that it reads. */
#ifndef IMPID_PLANT_CONTROLLER_H
#define IMPID_PLANT_CONTROLLER_H

#include "plant.h"

/* Reads the encoders at this instant: the nearest whole count. */
void impid_plant_read_encoders(const impid_plant *plant, int32_t *count);

/* One tick: reads the encoders, updates the velocity estimate, and gives the torque to hold, N m.
 * reference: q1, q2 (rad), w1, w2 (rad/s). */
void impid_plant_control(impid_plant *plant, const double *reference, double *torque);

#endif
