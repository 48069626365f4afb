#include "sensors.h"

#include <math.h>
#include <stdio.h>

int sensors_begin(sensors* hand, const tendonfmu_finger* finger) {
  char path[80];
  hand->joints = tendonfmu_joint_count(finger);
  hand->tendons = tendonfmu_tendon_count(finger);
  for (size_t i = 0; i < hand->tendons; ++i) {
    snprintf(path, sizeof path, "tendons[%zu].stiffness", i + 1);
    if (tendonfmu_get_parameter(finger, path, &hand->stiffness[i]) != TENDONFMU_OK) {
      return -1;
    }
    for (size_t j = 0; j < hand->joints; ++j) {
      snprintf(path, sizeof path, "tendons[%zu].moment_arms[%zu]", i + 1, j + 1);
      if (tendonfmu_get_parameter(finger, path, &hand->moment_arms[i][j]) != TENDONFMU_OK) {
        return -1;
      }
    }
  }
  return 0;
}

void sensors_read(const sensors* hand, double time, double* force, double* position) {
  const double phase = fmod(time, 2.0), angle = 0.2;
  const double pushed = phase > 1.5 && phase < 1.8 ? 8.0 : 0.0; /* N, by the environment */
  for (size_t i = 0; i < hand->tendons; ++i) {
    double travel = 0.0;
    for (size_t j = 0; j < hand->joints; ++j) {
      travel += hand->moment_arms[i][j] * angle;
    }
    force[i] = 12.0 + (travel > 0.0 ? pushed : 0.0);
    position[i] = travel + force[i] / hand->stiffness[i];
  }
}
