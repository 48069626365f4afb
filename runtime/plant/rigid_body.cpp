#include "rigid_body.h"

#include <Eigen/Geometry>

#include "elementary.h"

namespace tendonfmu::plant {
namespace {

/* By `angle` about `axis`, a unit vector (Rodrigues). */
Eigen::Matrix3d rotation(const three& axis, double angle) {
  const auto [s, c] = sine_cosine(angle);
  const three turned = s * axis, shared = (1.0 - c) * axis;
  Eigen::Matrix3d result = shared * axis.transpose();
  result.diagonal().array() += c;
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3, last = (k + 2) % 3;
    result(next, k) += turned[last];
    result(last, k) -= turned[next];
  }
  return result;
}

}  // namespace

void move_chain(const rig& rig, const double* angle, const double* speed, chain_motion* motion) {
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  three origin = three::Zero(), spin = origin, velocity = origin;
  for (std::size_t j = 0; j < rig.links.size(); ++j) {
    const link& link = rig.links[j];
    const three from_parent = frame * link.offset;
    velocity += spin.cross(from_parent);
    origin += from_parent;
    const three axis = frame * link.axis;
    frame *= rotation(link.axis, angle[j]);
    spin += speed[j] * axis;
    motion->links[j] = {frame, origin, axis, frame * link.centre_of_mass, spin, velocity};
  }
}

point_motion move_point(const link_motion& link, const three& point) {
  const three arm = link.frame * point;
  return {link.origin + arm, link.velocity + link.spin.cross(arm)};
}

void add_torque_of_force(const chain_motion& motion, std::size_t last, const three& place, const three& force,
                         double* torque) {
  for (std::size_t j = 0; j <= last; ++j) {
    const link_motion& link = motion.links[j];
    torque[j] += link.axis.dot((place - link.origin).cross(force));
  }
}

void inverse_dynamics(const rig& rig, const chain_motion& motion, const double* speed, const double* acceleration,
                      double* torque) {
  const std::size_t n = rig.links.size();
  three force[max_joints], moment[max_joints];
  three spin = three::Zero(), turning = spin, lift = -rig.gravity, origin = spin;  // of the parent; turning: ω'
  for (std::size_t j = 0; j < n; ++j) {
    const link_motion& link = motion.links[j];
    const three from_parent = link.origin - origin;
    lift += turning.cross(from_parent) + spin.cross(spin.cross(from_parent));
    turning += spin.cross(speed[j] * link.axis) + acceleration[j] * link.axis;
    spin = link.spin;
    origin = link.origin;
    force[j] = rig.links[j].mass * (lift + turning.cross(link.arm) + spin.cross(spin.cross(link.arm)));
    // the inertia is diagonal in the link's own axes
    const three& inertia = rig.links[j].inertia;
    const three own_spin = link.frame.transpose() * spin, own_turning = link.frame.transpose() * turning;
    const three change = inertia.cwiseProduct(own_turning) + own_spin.cross(inertia.cwiseProduct(own_spin));
    moment[j] = link.frame * change + link.arm.cross(force[j]);
  }
  for (std::size_t j = n; j-- > 0;) {
    torque[j] = motion.links[j].axis.dot(moment[j]);
    if (j > 0) {
      const three from_parent = motion.links[j].origin - motion.links[j - 1].origin;
      moment[j - 1] += moment[j] + from_parent.cross(force[j]);
      force[j - 1] += force[j];
    }
  }
}

void mass_matrix(const rig& rig, const chain_motion& motion, double* mass) {
  const std::size_t n = rig.links.size();
  // the bodies from joint j on, as one: mass, mass · centre, inertia about the base's origin
  double heavy = 0.0;
  three moment = three::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (std::size_t j = n; j-- > 0;) {
    const link_motion& link = motion.links[j];
    const double m = rig.links[j].mass;
    const three c = link.origin + link.arm;
    heavy += m;
    moment += m * c;
    inertia += link.frame * rig.links[j].inertia.asDiagonal() * link.frame.transpose() - m * c * c.transpose();
    inertia.diagonal().array() += m * c.squaredNorm();

    // turning joint j at 1 rad/s²: momentum of the composite and angular momentum about the base's origin
    const three slide = link.origin.cross(link.axis);  // velocity of the base's origin, were it part of the body
    const three force = link.axis.cross(moment) + heavy * slide;
    const three turning = inertia * link.axis + moment.cross(slide);
    for (std::size_t i = 0; i <= j; ++i) {
      const link_motion& other = motion.links[i];
      mass[i * n + j] = mass[j * n + i] = other.axis.dot(turning - other.origin.cross(force));
    }
  }
}

double kinetic_energy(const rig& rig, const chain_motion& motion) {
  double energy = 0.0;
  for (std::size_t j = 0; j < rig.links.size(); ++j) {
    const link_motion& link = motion.links[j];
    const three velocity = link.velocity + link.spin.cross(link.arm), spin = link.frame.transpose() * link.spin;
    energy += 0.5 * (rig.links[j].mass * velocity.squaredNorm() + rig.links[j].inertia.dot(spin.cwiseAbs2()));
  }
  return energy;
}

double gravity_energy(const rig& rig, const chain_motion& motion) {
  double energy = 0.0;
  for (std::size_t j = 0; j < rig.links.size(); ++j) {
    energy -= rig.links[j].mass * rig.gravity.dot(motion.links[j].origin + motion.links[j].arm);
  }
  return energy;
}

}  // namespace tendonfmu::plant
