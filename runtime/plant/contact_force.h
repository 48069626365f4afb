/* Forces on the finger from outside: scheduled pushes, the push of the inputs, and a compliant obstacle. Over numbers
 * or duals, since they depend on the posture. */
#pragma once

#include "motion.h"
#include "rigid_body.h"

namespace tendonfmu::plant {

/* A push of the inputs: force in the base frame at a point of a link. */
struct free_push {
  three force{}, point{};
  std::size_t link = 0;
};

/* Depth δ of the finger's point in the obstacle, m (negative: apart), and its growth. */
template <class T>
struct penetration {
  point_motion<T> point;
  vector3<T> normal;
  T depth{}, growth{};
};

template <class T>
penetration<T> penetrate(const obstacle& obstacle, const chain_motion<T>& motion) {
  penetration<T> found;
  found.point = move_point(motion.links[obstacle.link], obstacle.point);
  const vector3<T> apart = found.point.place - constant<T>(obstacle.centre);
  const T distance = square_root(dot(apart, apart));
  found.normal = (T(1.0) / distance) * apart;
  found.depth = T(obstacle.radius) - distance;
  found.growth = -dot(found.normal, found.point.velocity);
  return found;
}

template <class T>
struct contact_torque {
  T torque[max_joints]{}; /* Jᵀ F */
  T push_power{};         /* W, of pushes */
  T obstacle_loss{};      /* W, of the obstacle's damping */
  vector3<T> force{};     /* their sum */
  vector3<T> place{};     /* where the largest acts */
  double largest = 0.0;   /* N */
};

template <class T>
void act(const chain_motion<T>& motion, std::size_t link, const point_motion<T>& point, const vector3<T>& force,
         contact_torque<T>* total) {
  add_torque_of_force(motion, link, point.place, force, total->torque);
  total->force = total->force + force;
  const double strength = std::sqrt(value_of(dot(force, force)));
  if (strength > total->largest) {
    total->largest = strength;
    total->place = point.place;
  }
}

/* Scheduled pushes may be left out; the obstacle acts while `touching`. */
template <class T>
contact_torque<T> contact_torques(const rig& rig, const chain_motion<T>& motion, double time, bool scheduled,
                                  const free_push& free, bool touching) {
  contact_torque<T> total;
  const auto push_on = [&](std::size_t link, const three& at, const vector3<T>& force) {
    const point_motion<T> point = move_point(motion.links[link], at);
    act(motion, link, point, force, &total);
    total.push_power += dot(force, point.velocity);
  };
  if (scheduled) {
    for (const push& push : rig.pushes) {
      const double strength = push_strength(push, time);
      if (strength == 0.0) {
        continue;
      }
      const vector3<T> along = constant<T>(push.direction);
      push_on(push.link, push.point,
              T(strength) * (push.in_link_frame ? motion.links[push.link].frame * along : along));
    }
  }
  if (free.force[0] != 0.0 || free.force[1] != 0.0 || free.force[2] != 0.0) {
    push_on(free.link, free.point, constant<T>(free.force));
  }
  if (touching) {
    // K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", 1975
    const obstacle& sphere = rig.obstacle;
    const penetration<T> found = penetrate(sphere, motion);
    const T spring = T(sphere.stiffness) * found.depth;
    T strength = spring * (T(1.0) + T(sphere.damping) * found.growth);
    if (value_of(strength) < 0.0) {
      strength = T(0.0);
    }
    act(motion, sphere.link, found.point, strength * found.normal, &total);
    total.obstacle_loss = (strength - spring) * found.growth;
  }
  return total;
}

}  // namespace tendonfmu::plant
