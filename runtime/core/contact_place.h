/* Where a finger is touched, as far as the torques show it: the force at the tip and the least link that explains them
 * (docs/reference/semantics/contact_place.md#link-geometry). */
#pragma once

#include "finger_memory.h"

typedef struct tip_force {
  double force[3];     /* N, base frame; 0 along directions that the torques do not show */
  double deviation[3]; /* N, standard deviation of these; 0 where the torques' are not known */
  double misfit;       /* χ² per degree of freedom; 0 where nothing can contradict */
  int observable;      /* the torques show all three directions */
} tip_force;

/* The force at the tip that explains the torques best.
 *   lever       [joints × 3] m, of find_tip_levers()
 *   torque      [joints] N·m that the tendons hold: −lever · force
 *   deviation   [joints] N·m, their standard deviations, all above 0; NULL: not known */
tip_force find_tip_force(size_t joints, const double* lever, const double* torque, const double* deviation);

/* Contact is on this link, from 1, or beyond; −1 where the torques do not show it. Arrays as above and of
 * find_least_links(). */
int find_contact_link(size_t joints, const int* least, const double* torque, const double* deviation);

typedef struct contact_place {
  tip_force tip;
  int link; /* 0: no contact; of find_contact_link() */
} contact_place;

/* Of the sample last taken, from its outputs alone; all 0 without links. */
contact_place find_contact_place(const tendonfmu_finger* finger);
