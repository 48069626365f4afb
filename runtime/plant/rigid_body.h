/* The links as a serial chain of rigid bodies, in the base frame: R. Featherstone, "Rigid Body Dynamics Algorithms",
 * 2008, chapters 5 (recursive Newton-Euler) and 6 (composite bodies). */
#pragma once

#include <cstddef>

#include "rig.h"

namespace tendonfmu::plant {

/* Where the links are and how they move. */
struct link_motion {
  Eigen::Matrix3d frame;   /* columns: the axes of the link */
  three origin, axis, arm; /* of its joint; arm: centre of mass from the origin */
  three spin, velocity;    /* rad/s; m/s of the origin */
};

struct chain_motion {
  link_motion links[max_joints];
};

/* angle, speed: [n] */
void move_chain(const rig& rig, const double* angle, const double* speed, chain_motion* motion);

/* A point fixed to a link: place and velocity in the base frame. */
struct point_motion {
  three place, velocity;
};

point_motion move_point(const link_motion& link, const three& point);

/* Adds Jᵀ F of a force at a place on link `last` to torque [n]. */
void add_torque_of_force(const chain_motion& motion, std::size_t last, const three& place, const three& force,
                         double* torque);

/* Torques [n] that the motion with `acceleration` [n] needs: M q̈ + velocity terms + gravity. */
void inverse_dynamics(const rig& rig, const chain_motion& motion, const double* speed, const double* acceleration,
                      double* torque);

/* M(q), row-major [n × n]. */
void mass_matrix(const rig& rig, const chain_motion& motion, double* mass);

double kinetic_energy(const rig& rig, const chain_motion& motion);

/* Potential energy of the masses, J, 0 with all centres of mass in the base's origin. */
double gravity_energy(const rig& rig, const chain_motion& motion);

}  // namespace tendonfmu::plant
