#include "rigid_body.h"

namespace tendonfmu::plant {

void mass_matrix(const rig& rig, const chain_motion<double>& motion, double* mass) {
  using vector = vector3<double>;
  const std::size_t n = rig.links.size();
  // the bodies from joint j on, as one: mass, mass · centre, inertia about the base's origin (symmetric)
  double heavy = 0.0;
  vector moment = {0, 0, 0};
  double xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;
  for (std::size_t j = n; j-- > 0;) {
    const link_motion<double>& link = motion.links[j];
    const double m = rig.links[j].mass;
    const three& own = rig.links[j].inertia;
    const vector c = link.origin + link.arm;
    heavy += m;
    moment = moment + m * c;
    const vector* a = link.frame.column;
    const auto turned_inertia = [&](double vector::*p, double vector::*q) {
      return own[0] * (a[0].*p) * (a[0].*q) + own[1] * (a[1].*p) * (a[1].*q) + own[2] * (a[2].*p) * (a[2].*q);
    };
    xx += turned_inertia(&vector::x, &vector::x) + m * (c.y * c.y + c.z * c.z);
    yy += turned_inertia(&vector::y, &vector::y) + m * (c.x * c.x + c.z * c.z);
    zz += turned_inertia(&vector::z, &vector::z) + m * (c.x * c.x + c.y * c.y);
    xy += turned_inertia(&vector::x, &vector::y) - m * c.x * c.y;
    xz += turned_inertia(&vector::x, &vector::z) - m * c.x * c.z;
    yz += turned_inertia(&vector::y, &vector::z) - m * c.y * c.z;

    // turning joint j at 1 rad/s²: momentum of the composite and angular momentum about the base's origin
    const vector axis = link.axis;
    const vector slide = cross(link.origin, axis);  // velocity of the base's origin, were it part of the body
    const vector force = cross(axis, moment) + heavy * slide;
    const vector spin = {xx * axis.x + xy * axis.y + xz * axis.z, xy * axis.x + yy * axis.y + yz * axis.z,
                         xz * axis.x + yz * axis.y + zz * axis.z};
    const vector turning = spin + cross(moment, slide);
    for (std::size_t i = 0; i <= j; ++i) {
      const link_motion<double>& other = motion.links[i];
      const double value = dot(other.axis, turning - cross(other.origin, force));
      mass[i * n + j] = value;
      mass[j * n + i] = value;
    }
  }
}

double kinetic_energy(const rig& rig, const chain_motion<double>& motion) {
  double energy = 0.0;
  for (std::size_t j = 0; j < rig.links.size(); ++j) {
    const link_motion<double>& link = motion.links[j];
    const vector3<double> v = link.velocity + cross(link.spin, link.arm), w = link.frame.back(link.spin);
    const three& inertia = rig.links[j].inertia;
    energy += 0.5 * (rig.links[j].mass * dot(v, v) + inertia[0] * w.x * w.x + inertia[1] * w.y * w.y +
                     inertia[2] * w.z * w.z);
  }
  return energy;
}

double gravity_energy(const rig& rig, const chain_motion<double>& motion) {
  double energy = 0.0;
  for (std::size_t j = 0; j < rig.links.size(); ++j) {
    const vector3<double> centre = motion.links[j].origin + motion.links[j].arm;
    energy -= rig.links[j].mass * dot(constant<double>(rig.gravity), centre);
  }
  return energy;
}

}  // namespace tendonfmu::plant
