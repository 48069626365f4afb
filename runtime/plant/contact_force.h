/* Forces on the finger from outside: scheduled pushes, the push of the inputs, and a compliant obstacle. */
#pragma once

#include "rigid_body.h"

namespace tendonfmu::plant {

/* A push of the inputs: force in the base frame at a point of a link. */
struct free_push {
  three force = three::Zero(), point = three::Zero();
  std::size_t link = 0;
};

/* Depth δ of the finger's point in the obstacle, m (negative: apart), and its growth. */
struct penetration {
  point_motion point;
  three normal;
  double depth, growth;
};

penetration penetrate(const obstacle& obstacle, const chain_motion& motion);

struct contact_torque {
  double torque[max_joints]{};                        /* Jᵀ F */
  double push_power = 0.0;                            /* W, of pushes */
  double obstacle_loss = 0.0;                         /* W, of the obstacle's damping */
  three force = three::Zero(), place = three::Zero(); /* their sum; where the largest acts */
  double largest = 0.0;                               /* N */
};

/* Scheduled pushes may be left out; the obstacle acts while `touching`. */
contact_torque contact_torques(const rig& rig, const chain_motion& motion, double time, bool scheduled,
                               const free_push& free, bool touching);

}  // namespace tendonfmu::plant
