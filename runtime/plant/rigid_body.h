/* The links as a serial chain of rigid bodies, in the base frame: R. Featherstone, "Rigid Body Dynamics Algorithms",
 * 2008, chapters 5 (recursive Newton-Euler) and 6 (composite bodies). Over numbers or duals. */
#pragma once

#include <cstddef>

#include "rig.h"
#include "vector3.h"

namespace tendonfmu::plant {

/* Where the links are and how they move. */
template <class T>
struct link_motion {
  rotation<T> frame;            /* axes of the link */
  vector3<T> origin, axis, arm; /* of its joint; arm: centre of mass from the origin */
  vector3<T> spin, velocity;    /* rad/s; m/s of the origin */
};

template <class T>
struct chain_motion {
  link_motion<T> links[max_joints];
};

/* angle, speed: [n] */
template <class T>
void move_chain(const rig& rig, const T* angle, const T* speed, chain_motion<T>* motion) {
  rotation<T> frame = {{constant<T>({1, 0, 0}), constant<T>({0, 1, 0}), constant<T>({0, 0, 1})}};
  vector3<T> origin = constant<T>({0, 0, 0}), spin = origin, velocity = origin;
  for (std::size_t j = 0; j < rig.links.size(); ++j) {
    const link& link = rig.links[j];
    const vector3<T> from_parent = frame * constant<T>(link.offset);
    velocity = velocity + cross(spin, from_parent);
    origin = origin + from_parent;
    const vector3<T> axis = frame * constant<T>(link.axis);
    frame = turned(frame, link.axis, angle[j]);
    spin = spin + speed[j] * axis;
    motion->links[j] = {frame, origin, axis, frame * constant<T>(link.centre_of_mass), spin, velocity};
  }
}

/* A point fixed to a link: place and velocity in the base frame. */
template <class T>
struct point_motion {
  vector3<T> place, velocity;
};

template <class T>
point_motion<T> move_point(const link_motion<T>& link, const three& point) {
  const vector3<T> arm = link.frame * constant<T>(point);
  return {link.origin + arm, link.velocity + cross(link.spin, arm)};
}

/* Adds Jᵀ F of a force at a place on link `last` to torque [n]. */
template <class T>
void add_torque_of_force(const chain_motion<T>& motion, std::size_t last, const vector3<T>& place,
                         const vector3<T>& force, T* torque) {
  for (std::size_t j = 0; j <= last; ++j) {
    const link_motion<T>& link = motion.links[j];
    torque[j] += dot(link.axis, cross(place - link.origin, force));
  }
}

/* Torques [n] that the motion with `acceleration` [n] needs: M q̈ + velocity terms + gravity. */
template <class T>
void inverse_dynamics(const rig& rig, const chain_motion<T>& motion, const T* speed, const double* acceleration,
                      T* torque) {
  const std::size_t n = rig.links.size();
  vector3<T> force[max_joints], moment[max_joints];
  vector3<T> spin = constant<T>({0, 0, 0}), turning = spin;  // of the parent: ω, ω'
  vector3<T> lift = constant<T>({-rig.gravity[0], -rig.gravity[1], -rig.gravity[2]}), origin = spin;

  for (std::size_t j = 0; j < n; ++j) {
    const link_motion<T>& link = motion.links[j];
    const vector3<T> from_parent = link.origin - origin;
    lift = lift + cross(turning, from_parent) + cross(spin, cross(spin, from_parent));
    turning = turning + cross(spin, speed[j] * link.axis) + T(acceleration[j]) * link.axis;
    spin = link.spin;
    origin = link.origin;
    const vector3<T> pull = lift + cross(turning, link.arm) + cross(spin, cross(spin, link.arm));
    force[j] = T(rig.links[j].mass) * pull;
    // the inertia is diagonal in the link's own axes
    const three& inertia = rig.links[j].inertia;
    const vector3<T> own_turning = link.frame.back(turning), own_spin = link.frame.back(spin);
    const vector3<T> momentum = {inertia[0] * own_spin.x, inertia[1] * own_spin.y, inertia[2] * own_spin.z};
    const vector3<T> change = {inertia[0] * own_turning.x, inertia[1] * own_turning.y, inertia[2] * own_turning.z};
    moment[j] = link.frame * (change + cross(own_spin, momentum)) + cross(link.arm, force[j]);
  }
  for (std::size_t j = n; j-- > 0;) {
    torque[j] = dot(motion.links[j].axis, moment[j]);
    if (j == 0) {
      break;
    }
    const vector3<T> from_parent = motion.links[j].origin - motion.links[j - 1].origin;
    moment[j - 1] = moment[j - 1] + moment[j] + cross(from_parent, force[j]);
    force[j - 1] = force[j - 1] + force[j];
  }
}

/* M(q), row-major [n × n]. */
void mass_matrix(const rig& rig, const chain_motion<double>& motion, double* mass);

double kinetic_energy(const rig& rig, const chain_motion<double>& motion);

/* Potential energy of the masses, J, 0 with all centres of mass in the base's origin. */
double gravity_energy(const rig& rig, const chain_motion<double>& motion);

}  // namespace tendonfmu::plant
