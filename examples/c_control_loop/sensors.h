/* Stands for the drivers of your hand. Here: a finger that holds still and is pushed for 0.3 s of every 2 s. */
#ifndef SENSORS_H
#define SENSORS_H

#include <tendonfmu.h>

typedef struct sensors {
  size_t joints, tendons;
  double moment_arms[64][16]; /* m */
  double stiffness[64];       /* N/m */
} sensors;

/* Reads the geometry of the finger from its parameters; 0 when done. */
int sensors_begin(sensors* hand, const tendonfmu_finger* finger);

/* Tendon forces (N) and motor-side positions (m), [tendons] each, at a time (s). */
void sensors_read(const sensors* hand, double time, double* force, double* position);

#endif
