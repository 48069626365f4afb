#include "contact_force.h"

#include <Eigen/Geometry>

#include "motion.h"

namespace tendonfmu::plant {
namespace {

void act(const chain_motion& motion, std::size_t link, const point_motion& point, const three& force,
         contact_torque* total) {
  add_torque_of_force(motion, link, point.place, force, total->torque);
  total->force += force;
  const double strength = force.norm();
  if (strength > total->largest) {
    total->largest = strength;
    total->place = point.place;
  }
}

}  // namespace

penetration penetrate(const obstacle& obstacle, const chain_motion& motion) {
  const point_motion point = move_point(motion.links[obstacle.link], obstacle.point);
  const three apart = point.place - obstacle.centre;
  const double distance = apart.norm();
  const three normal = apart / distance;
  return {point, normal, obstacle.radius - distance, -normal.dot(point.velocity)};
}

contact_torque contact_torques(const rig& rig, const chain_motion& motion, double time, bool scheduled,
                               const free_push& free, bool touching) {
  contact_torque total;
  const auto push_on = [&](std::size_t link, const three& at, const three& force) {
    const point_motion point = move_point(motion.links[link], at);
    act(motion, link, point, force, &total);
    total.push_power += force.dot(point.velocity);
  };
  for (const push& push : rig.pushes) {
    const double strength = scheduled ? push_strength(push, time) : 0.0;
    if (strength != 0.0) {
      const three along = push.in_link_frame ? motion.links[push.link].frame * push.direction : push.direction;
      push_on(push.link, push.point, strength * along);
    }
  }
  if (!free.force.isZero(0.0)) {
    push_on(free.link, free.point, free.force);
  }
  if (touching) {
    // K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", 1975
    const obstacle& sphere = rig.obstacle;
    const penetration found = penetrate(sphere, motion);
    const double spring = sphere.stiffness * found.depth;
    const double strength = std::max(spring * (1.0 + sphere.damping * found.growth), 0.0);
    act(motion, sphere.link, found.point, strength * found.normal, &total);
    total.obstacle_loss = (strength - spring) * found.growth;
  }
  return total;
}

}  // namespace tendonfmu::plant
