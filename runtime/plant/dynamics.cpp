#include "dynamics.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "motion.h"

namespace tendonfmu::plant {
namespace {

/* Part of the friction that does not grow with the tension, as an addition p(f) to the tension that presses: P for a
 * taut tendon, fading to 0 with it, so that friction never makes a tendon push. */
struct preload {
  double force, by_force;
};

preload preload_at(double preload_force, double tension) {
  if (preload_force == 0.0) {
    return {0.0, 0.0};
  }
  const double rest = exponential(-tension / preload_force);
  return {preload_force * (1.0 - rest), rest};
}

}  // namespace

dynamics::dynamics(const rig& rig) : rig_(rig), layout_(rig), values_(rig.bristle_count()) {
  values_.arm.resize(rig.tendon_count() * rig.joint_count());
  values_.passed.resize(padded(rig.sites.size()));
  values_.tension.resize(rig.sites.size());
  values_.loss_by_share.resize(rig.sites.size());
  values_.loss_by_force.resize(rig.sites.size());
  for (std::size_t s = 0; s < rig.sites.size(); ++s) {
    values_.laws.inverse_length[s] = rig.sites[s].inverse_length;
  }
  for (std::size_t s = 0; s < rig.joint_sites.size(); ++s) {
    values_.laws.inverse_length[rig.sites.size() + s] = rig.joint_sites[s].inverse_length;
  }
}

/* Moment arms, elongations and forces at the springs. */
void dynamics::move_tendons(const double* state) {
  const std::size_t n = layout_.joints;
  const double *q = state, *speed = state + layout_.speed();
  evaluation& e = values_;
  std::fill(e.spring_torque, e.spring_torque + n, 0.0);
  e.spring_loss = 0.0;
  e.motor_power = 0.0;
  for (std::size_t i = 0; i < layout_.tendons; ++i) {
    const tendon& tendon = rig_.tendons[i];
    double* arm = &e.arm[i * n];
    double path = 0.0, path_speed = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      arm[j] = arm_at(tendon.arms[j], q[j]);
      path += path_of(tendon.arms[j], q[j]);
      path_speed += arm[j] * speed[j];
    }
    const double motor_speed = state[layout_.motor_speed() + i];
    const double stretch = state[layout_.motor() + i] - path, stretching = motor_speed - path_speed;
    e.elongation[i] = stretch;
    e.elongation_speed[i] = stretching;
    const bool slack = e.modes.slack[i];
    const double elastic = stretch * (tendon.stiffness + tendon.hardening * stretch);
    const double total = elastic + tendon.damping * stretching;
    // a tendon cannot push: neither by its spring nor by its damper
    const bool pulls = !slack && (tendon.damping == 0.0 || total > 0.0);
    const double pulling = pulls ? 1.0 : 0.0;
    e.force[i] = pulls ? total : 0.0;
    e.force_by_elongation[i] = pulling * (tendon.stiffness + 2.0 * tendon.hardening * stretch);
    e.force_by_speed[i] = pulling * tendon.damping;
    if (!slack) {
      e.spring_loss += (e.force[i] - elastic) * stretching;
    }
    e.motor_power += e.force[i] * motor_speed;
    for (std::size_t j = 0; j < n; ++j) {
      e.spring_torque[j] += arm[j] * e.force[i];
    }
  }
}

/* Sliding velocities and laws of all sites, then what all bristles do. */
void dynamics::bend_bristles(const double* state) {
  const std::size_t n = layout_.joints;
  const double *q = state, *speed = state + layout_.speed();
  const friction_settings& settings = rig_.friction;
  evaluation& e = values_;
  e.wrist_speed = 0.0;
  if (!rig_.wrist.arms.empty()) {
    const double omega = 2.0 * pi / rig_.wrist.period;
    e.wrist_speed = rig_.wrist.amplitude * omega * cosine(omega * std::max(e.time, 0.0));
  }
  for (std::size_t i = 0; i < layout_.tendons; ++i) {
    const tendon& tendon = rig_.tendons[i];
    const double* arm = &e.arm[i * n];
    // eq. (5) for every link: sum of the joints from there on
    double sliding[max_joints + 1];
    sliding[n] = 0.0;
    for (std::size_t j = n; j-- > 0;) {
      sliding[j] = sliding[j + 1] + arm[j] * speed[j];
    }
    for (std::size_t s = tendon.first_site; s < tendon.first_site + tendon.site_count; ++s) {
      const friction_site& site = rig_.sites[s];
      double v = sliding[site.first_mover];
      if (site.where == friction_site::place::wrist) {
        v += rig_.wrist.arms[i] * e.wrist_speed;
      }
      set_site_law(site, site.bends ? q[site.angle_joint] : 0.0, v, settings.stribeck_exponent, s, &e.laws);
    }
  }
  const std::size_t first = rig_.sites.size();
  for (std::size_t s = 0; s < rig_.joint_sites.size(); ++s) {
    const joint_site& site = rig_.joint_sites[s];
    set_law(site.friction, speed[site.joint], settings.stribeck_exponent, first + s, &e.laws);
  }
  std::copy(state + layout_.bristle(), state + layout_.heat(), e.bristles.begin());
  respond(e.laws, {e.level, settings.bristle_damping, slopes_}, e.bristles.data(), &e.responses);
}

/* Tension along every tendon, and what it leaves for the joints. */
void dynamics::rub_tendons() {
  const std::size_t n = layout_.joints;
  const friction_settings& settings = rig_.friction;
  evaluation& e = values_;
  const double* share = e.responses.share.data();
  const bool capstan = settings.loss == tension_loss::capstan;
  for (std::size_t s = 0; capstan && s < rig_.sites.size(); s += pair_size) {
    pair two;
    std::memcpy(&two, share + s, sizeof two);
    two = exponential(-two);
    std::memcpy(&e.passed[s], &two, sizeof two);
  }

  std::fill(e.passed_torque, e.passed_torque + n, 0.0);
  std::fill(e.load, e.load + n, 0.0);
  e.wrist_power = 0.0;
  for (std::size_t i = 0; i < layout_.tendons; ++i) {
    const tendon& tendon = rig_.tendons[i];
    const double* arm = &e.arm[i * n];
    double tension = e.force[i];
    for (std::size_t s = tendon.first_site; s < tendon.first_site + tendon.site_count; ++s) {
      const preload extra = preload_at(settings.preload, tension);
      const double passed = capstan ? e.passed[s] : 1.0 - share[s];
      e.loss_by_share[s] = -(capstan ? tension * passed : tension) - extra.force;
      e.loss_by_force[s] = passed - extra.by_force * share[s];
      tension = tension * passed - extra.force * share[s];
      // friction beyond the tension takes all of it: a tendon never pushes
      if (tension < 0.0) {
        tension = e.loss_by_share[s] = e.loss_by_force[s] = 0.0;
      }
      e.tension[s] = tension;
    }
    // what moves the wrist works against the friction there, beside the finger
    if (e.wrist_speed != 0.0) {
      e.wrist_power += rig_.wrist.arms[i] * e.wrist_speed * (e.force[i] - e.tension[tendon.first_site]);
    }
    const auto after = [&](std::size_t count) {
      return count == 0 ? e.force[i] : e.tension[tendon.first_site + count - 1];
    };
    for (std::size_t j = 0; j < n; ++j) {
      e.passed_torque[j] += arm[j] * after(tendon.sites_before_torque[j]);
      if (tendon.loads[j]) {
        e.load[j] += after(tendon.sites_before_load[j]);
      }
    }
  }
  for (std::size_t s = 0; s < rig_.joint_sites.size(); ++s) {
    const joint_site& site = rig_.joint_sites[s];
    e.passed_torque[site.joint] -= (site.by_load ? e.load[site.joint] : 1.0) * share[rig_.sites.size() + s];
  }
}

void dynamics::press_stops(const double* state) {
  const contact_modes& modes = values_.modes;
  values_.stop_loss = 0.0;
  for (std::size_t j = 0; j < layout_.joints; ++j) {
    const link& link = rig_.links[j];
    const double q = state[j], speed = state[layout_.speed() + j];
    double torque = 0.0;
    if (modes.below[j] || modes.above[j]) {
      const double spring = link.stop_stiffness * ((modes.below[j] ? link.lower : link.upper) - q);
      torque = spring - link.stop_damping * speed;
      // a stop never pulls
      if (modes.below[j] ? torque < 0.0 : torque > 0.0) {
        torque = 0.0;
      }
      values_.stop_loss -= (torque - spring) * speed;
    }
    values_.stop_torque[j] = torque;
  }
}

void dynamics::command_motors(double time, const commands& inputs, double* command) const {
  const std::size_t m = layout_.tendons;
  if (inputs.scheduled_motion) {
    scheduled_command(rig_, time, inputs.pretension, command);
    for (std::size_t i = 0; i < m; ++i) {
      command[i] += inputs.command[i];
    }
    return;
  }
  if (inputs.given) {
    std::copy(inputs.command, inputs.command + m, command);
  } else {
    hold_command(rig_, command);
  }
  if (inputs.pretension == 0.0) {
    return;
  }
  // on top of the rig's own: a hardening spring gives way less then
  const double own = at_time(rig_.pretension, 0.0), both = own + inputs.pretension;
  for (std::size_t i = 0; i < m; ++i) {
    const double share = rig_.null_vector[i];
    command[i] += elongation_of(rig_.tendons[i], both * share) - elongation_of(rig_.tendons[i], own * share);
  }
}

void dynamics::evaluate(double time, const double* state, const contact_modes* modes, const commands& inputs,
                        double* derivative) {
  const std::size_t n = layout_.joints, m = layout_.tendons;
  const double *q = state, *speed = state + layout_.speed(), heat = state[layout_.heat()];
  const friction_settings& friction = rig_.friction;
  evaluation& e = values_;
  e.time = time;

  // level of all friction: run-in over time and dissipated heat
  const double run_in =
      1.0 + friction.drift_amplitude * (1.0 - exponential(-std::max(time, 0.0) / friction.drift_time));
  e.level = run_in * (1.0 + friction.heat_coefficient * heat);

  // bodies and what presses on them
  move_chain(rig_, q, speed, &e.motion);
  mass_matrix(rig_, e.motion, e.mass);
  const double no_acceleration[max_joints] = {};
  inverse_dynamics(rig_, e.motion, speed, no_acceleration, e.rigid_torque);
  e.modes = modes ? *modes : modes_at(state);
  e.contact = contact_torques(rig_, e.motion, time, inputs.scheduled_pushes, inputs.push, e.modes.touching);

  // tendons, friction, stops
  move_tendons(state);
  bend_bristles(state);
  rub_tendons();
  press_stops(state);

  // balance of torques
  double loss = e.spring_loss + e.stop_loss + e.contact.obstacle_loss;
  e.friction_power = e.wrist_power;
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_joints, 1> torque(n);
  for (std::size_t j = 0; j < n; ++j) {
    const link& link = rig_.links[j];
    const double bent = q[j] - link.cover_rest;
    torque[j] = e.passed_torque[j] + e.stop_torque[j] + e.contact.torque[j] - e.rigid_torque[j] -
                bent * (link.cover_stiffness + link.cover_hardening * bent * bent) - link.damping * speed[j];
    loss += link.damping * speed[j] * speed[j];
    e.friction_power += (e.spring_torque[j] - e.passed_torque[j]) * speed[j];
  }
  for (std::size_t j = 0; j + 1 < n; ++j) {
    const double couple =
        rig_.coupling[j] * ((q[j] - rig_.links[j].cover_rest) - (q[j + 1] - rig_.links[j + 1].cover_rest));
    torque[j] -= couple;
    torque[j + 1] += couple;
  }
  using mass_type = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, max_joints, max_joints>;
  const mass_type mass = Eigen::Map<const mass_type>(e.mass, n, n);
  torque = mass.llt().solve(torque);
  std::copy(torque.data(), torque.data() + n, e.acceleration);

  // derivatives
  std::copy(speed, speed + n, derivative);
  std::copy(e.acceleration, e.acceleration + n, derivative + layout_.speed());
  double command[max_tendons];
  command_motors(time, inputs, command);
  const double omega = 2.0 * pi * rig_.servo_frequency;
  for (std::size_t i = 0; i < m; ++i) {
    const double motor_speed = state[layout_.motor_speed() + i];
    derivative[layout_.motor() + i] = motor_speed;
    derivative[layout_.motor_speed() + i] =
        omega * (omega * (command[i] - state[layout_.motor() + i]) - 2.0 * rig_.servo_damping * motor_speed);
  }
  for (std::size_t s = 0; s < layout_.bristles; ++s) {
    derivative[layout_.bristle() + s] = e.responses.rate[s];
  }
  derivative[layout_.heat()] = e.friction_power - heat / friction.heat_time;
  derivative[layout_.motor_work()] = e.motor_power + e.wrist_power;
  derivative[layout_.friction_work()] = e.friction_power;
  derivative[layout_.damping_work()] = loss;
  derivative[layout_.push_work()] = e.contact.push_power;
}

std::size_t dynamics::root_count() const {
  return layout_.tendons + 2 * layout_.joints + (rig_.obstacle.present ? 1 : 0);
}

void dynamics::roots(const double* state, double* root) const {
  const std::size_t n = layout_.joints, m = layout_.tendons;
  for (std::size_t i = 0; i < m; ++i) {
    double path = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      path += path_of(rig_.tendons[i].arms[j], state[j]);
    }
    root[i] = state[layout_.motor() + i] - path;
  }
  for (std::size_t j = 0; j < n; ++j) {
    root[m + 2 * j] = rig_.links[j].lower - state[j];
    root[m + 2 * j + 1] = state[j] - rig_.links[j].upper;
  }
  if (rig_.obstacle.present) {
    chain_motion motion;
    move_chain(rig_, state, state + layout_.speed(), &motion);
    root[m + 2 * n] = penetrate(rig_.obstacle, motion).depth;
  }
}

contact_modes dynamics::modes_at(const double* state) const {
  double root[max_roots];
  roots(state, root);
  contact_modes modes;
  visit_modes(&modes, [&](std::size_t k, bool& mode, bool when_positive) { mode = (root[k] > 0.0) == when_positive; });
  return modes;
}

void dynamics::switch_modes(const int* found, contact_modes* modes) const {
  visit_modes(modes, [&](std::size_t k, bool& mode, bool when_positive) {
    if (found[k] != 0) {
      mode = (found[k] > 0) == when_positive;
    }
  });
}

}  // namespace tendonfmu::plant
