/* The robot's joint controller and the encoders that it reads. */
#ifndef IMPID_PLANT_CONTROLLER_H
#define IMPID_PLANT_CONTROLLER_H

#include "plant.h"

/* Reads the encoders at this instant: the nearest whole count. */
void impid_plant_read_encoders(const impid_plant *plant, int32_t *count);

/* The controller's memory of a robot that has always rested here. */
void impid_plant_rest_control(impid_plant *plant);

/* One tick: reads the encoders, updates the velocity estimate, and gives the torque to hold, N m.
 * reference: see impid_plant_run. */
void impid_plant_control(impid_plant *plant, const double *reference, double *torque);

#endif
