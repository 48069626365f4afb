/* What happens over time: what the motors are commanded (joint angles, pretension), and the pushes. */
#pragma once

#include "elementary.h"
#include "rig.h"

namespace tendonfmu::plant {

/* Quintic Hermite interpolation, constant outside: continuous with two derivatives. */
double at_time(const knots& knots, double time);

/* Path of a tendon for one joint, ∫ r dq from 0, and its moment arm. */
inline double path_of(const moment_arm& arm, double angle) {
  double path = angle * (arm.mean + 0.5 * arm.slope * angle);
  if (arm.eccentricity != 0.0) {
    path += arm.eccentricity * (cosine(arm.phase) - cosine(angle + arm.phase));
  }
  return path;
}

inline double arm_at(const moment_arm& arm, double angle) {
  double r = arm.mean + arm.slope * angle;
  if (arm.eccentricity != 0.0) {
    r += arm.eccentricity * sine(angle + arm.phase);
  }
  return r;
}

/* Elongation (m) at which a tendon pulls with `force` (N), and back. */
double elongation_of(const tendon& tendon, double force);

/* Desired joint angles [n]; before time 0 the finger moves to the first posture from another one (rig key `settle`). */
void desired_angles(const rig& rig, double time, double* angle);

/* Motor positions [m] for the rig's own motion, with `extra` N of pretension beside its own. */
void scheduled_command(const rig& rig, double time, double extra, double* command);

/* Motor positions that hold the first posture with the first pretension, [m]. */
void hold_command(const rig& rig, double* command);

/* N; ramps as raised cosines: no kink that an integrator would stumble over. */
double push_strength(const push& push, double time);

/* Times at which a push begins, is full, lets go and ends, of all pushes, increasing: no step may pass over one. */
std::vector<double> push_times(const rig& rig);

}  // namespace tendonfmu::plant
