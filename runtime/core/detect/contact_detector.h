/* Contact: a joint whose residual exceeds its threshold (paper VI), or what bounds learned from free motion say
 * (docs/reference/semantics/detection.md). */
#pragma once

#include "finger_memory.h"

/* The bands of all joints at the first sample. */
void begin_detection(tendonfmu_finger* finger, double time);

/* Whether any joint is in contact; level and joint_contact of each. */
int detect_contact(tendonfmu_finger* finger, double mean_force, double time, double step);

/* Square of compensated_torque_std. */
void estimate_variance(tendonfmu_finger* finger, double mean_force);
