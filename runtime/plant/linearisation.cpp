#include "linearisation.h"

#include <algorithm>
#include <cmath>

namespace tendonfmu::plant {
namespace {

constexpr int lanes = 8;
using slopes = dual<lanes>;

/* Rows of slopes below the n torques. */
enum power : std::size_t { friction_power, motor_power, damping_power, push_power, powers };
constexpr power order_of_works[powers] = {motor_power, friction_power, damping_power, push_power};

}  // namespace

linearisation::linearisation(const rig& rig)
    : rig_(rig),
      layout_(rig),
      n_(rig.joint_count()),
      m_(rig.tendon_count()),
      k_(rig.bristle_count()),
      omega_(2.0 * pi * rig.servo_frequency),
      damping_(2.0 * rig.servo_damping * omega_),
      heat_rate_(1.0 / rig.friction.heat_time),
      mass_(n_, n_),
      by_angle_(n_ + powers, n_),
      by_speed_(n_ + powers, n_),
      by_motor_(n_ + powers, m_),
      by_motor_speed_(n_ + powers, m_),
      by_bristle_(n_ + powers, k_),
      by_heat_(n_ + powers),
      bristle_own_(k_),
      bristle_by_angle_(k_, n_),
      bristle_by_speed_(k_, n_),
      bristle_factor_(k_) {}

void linearisation::take(const dynamics& equations, const double* state, const commands& inputs) {
  const evaluation& e = equations.last();
  const double* speed = state + layout_.speed();
  mass_ = Eigen::Map<const matrix>(e.mass, n_, n_);
  for (matrix* slopes :
       {&by_angle_, &by_speed_, &by_motor_, &by_motor_speed_, &by_bristle_, &bristle_by_angle_, &bristle_by_speed_}) {
    slopes->setZero();
  }
  by_heat_.setZero();

  // torque that tendons and joint friction pass on
  for (std::size_t i = 0; i < m_; ++i) {
    tendon_slopes(e, speed, i);
  }
  joint_slopes(e);
  power_row(e, speed);
  // the rest of the torque
  diagonal_slopes(e, state);
  work_rows(e, state);
  if (e.wrist_speed != 0.0) {
    wrist_slopes(e, speed);
  }
  body_slopes(e, state, inputs);
}

/* Slopes of the passed torque by what one tendon does. Backward along the tendon: `weight` is the slope of the torque
 * on one joint by the tension that leaves the present site. */
void linearisation::tendon_slopes(const evaluation& e, const double* speed, std::size_t i) {
  const tendon& tendon = rig_.tendons[i];
  const double *arm = &e.arm[i * n_], *arm_slope = &e.arm_slope[i * n_];
  // slope of the joint's friction torque by its load
  double by_load[max_joints] = {};
  for (std::size_t s = 0; s < rig_.joint_sites.size(); ++s) {
    const joint_site& site = rig_.joint_sites[s];
    if (site.by_load && tendon.loads[site.joint]) {
      by_load[site.joint] = e.responses.share[rig_.sites.size() + s];
    }
  }
  for (std::size_t j = 0; j < n_; ++j) {
    double by_velocity[max_joints] = {};  // by the sliding velocity in link k, sites that start to slide there
    double weight = 0.0;
    for (std::size_t passed = tendon.site_count;; --passed) {
      if (tendon.sites_before_torque[j] == passed) {
        weight += arm[j];
      }
      if (tendon.sites_before_load[j] == passed) {
        weight -= by_load[j];
      }
      if (passed == 0) {
        break;
      }
      if (weight == 0.0) {
        continue;
      }
      const std::size_t s = tendon.first_site + passed - 1;
      const friction_site& site = rig_.sites[s];
      const double by_share = weight * e.loss_by_share[s];
      by_bristle_(j, s) += by_share * e.responses.share_by_bristle[s];
      by_heat_[j] += by_share * e.responses.share_by_level[s] * e.level_by_heat;
      by_angle_(j, site.angle_joint) += by_share * e.responses.share_by_angle[s];
      by_velocity[site.first_mover] += by_share * e.responses.share_by_velocity[s];
      weight *= e.loss_by_force[s];
    }
    // eq. (5) turned round: joint k moves every site whose first mover is not beyond it
    const double by_elongation = weight * e.force_by_elongation[i], by_stretching = weight * e.force_by_speed[i];
    double total = 0.0;
    for (std::size_t k = 0; k < n_; ++k) {
      total += by_velocity[k];
      by_speed_(j, k) += arm[k] * (total - by_stretching);
      by_angle_(j, k) += arm_slope[k] * speed[k] * (total - by_stretching) - arm[k] * by_elongation;
    }
    by_motor_(j, i) = by_elongation;
    by_motor_speed_(j, i) = by_stretching;
    const std::size_t passed = tendon.sites_before_torque[j];
    const double tension = passed == 0 ? e.force[i] : e.tension[tendon.first_site + passed - 1];
    by_angle_(j, j) += arm_slope[j] * tension;
  }
  for (std::size_t s = tendon.first_site; s < tendon.first_site + tendon.site_count; ++s) {
    const friction_site& site = rig_.sites[s];
    bristle_own_[s] = e.responses.rate_by_bristle[s];
    for (std::size_t k = site.first_mover; k < n_; ++k) {
      bristle_by_speed_(s, k) = e.responses.rate_by_velocity[s] * arm[k];
      bristle_by_angle_(s, k) = e.responses.rate_by_velocity[s] * arm_slope[k] * speed[k];
    }
    bristle_by_angle_(s, site.angle_joint) += e.responses.rate_by_angle[s];
  }
}

void linearisation::joint_slopes(const evaluation& e) {
  for (std::size_t s = 0; s < rig_.joint_sites.size(); ++s) {
    const joint_site& site = rig_.joint_sites[s];
    const std::size_t j = site.joint, b = rig_.sites.size() + s;
    const double load = site.by_load ? e.load[j] : 1.0;
    by_bristle_(j, b) -= load * e.responses.share_by_bristle[b];
    by_speed_(j, j) -= load * e.responses.share_by_velocity[b];
    by_heat_[j] -= load * e.responses.share_by_level[b] * e.level_by_heat;
    bristle_own_[b] = e.responses.rate_by_bristle[b];
    bristle_by_speed_(b, j) = e.responses.rate_by_velocity[b];
  }
}

/* The power of friction, (torque at the springs − passed torque)ᵀ q̇. */
void linearisation::power_row(const evaluation& e, const double* speed) {
  const Eigen::Map<const Eigen::VectorXd> v(speed, n_);
  by_angle_.row(n_) = -v.transpose() * by_angle_.topRows(n_);
  by_speed_.row(n_) = -v.transpose() * by_speed_.topRows(n_);
  by_motor_.row(n_) = -v.transpose() * by_motor_.topRows(n_);
  by_motor_speed_.row(n_) = -v.transpose() * by_motor_speed_.topRows(n_);
  by_bristle_.row(n_) = -v.transpose() * by_bristle_.topRows(n_);
  by_heat_[n_] = -v.dot(by_heat_.head(n_));
  for (std::size_t j = 0; j < n_; ++j) {
    by_speed_(n_, j) += e.spring_torque[j] - e.passed_torque[j];
  }
  for (std::size_t i = 0; i < m_; ++i) {
    const double *arm = &e.arm[i * n_], *arm_slope = &e.arm_slope[i * n_];
    double path_speed = 0.0;
    for (std::size_t j = 0; j < n_; ++j) {
      path_speed += arm[j] * speed[j];
    }
    for (std::size_t k = 0; k < n_; ++k) {
      by_angle_(n_, k) += arm_slope[k] * speed[k] * (e.force[i] - path_speed * e.force_by_speed[i]) -
                          path_speed * e.force_by_elongation[i] * arm[k];
      by_speed_(n_, k) -= path_speed * e.force_by_speed[i] * arm[k];
    }
    by_motor_(n_, i) += path_speed * e.force_by_elongation[i];
    by_motor_speed_(n_, i) += path_speed * e.force_by_speed[i];
  }
}

/* Covers, couplings, dampers and stops. */
void linearisation::diagonal_slopes(const evaluation& e, const double* state) {
  for (std::size_t j = 0; j < n_; ++j) {
    const link& link = rig_.links[j];
    const double bent = state[j] - link.cover_rest;
    by_angle_(j, j) -= link.cover_stiffness + 3.0 * link.cover_hardening * bent * bent;
    by_speed_(j, j) -= link.damping;
    if ((e.modes.below[j] || e.modes.above[j]) && e.stop_torque[j] != 0.0) {
      by_angle_(j, j) -= link.stop_stiffness;
      by_speed_(j, j) -= link.stop_damping;
    }
    if (j + 1 < n_) {
      by_angle_(j, j) -= rig_.coupling[j];
      by_angle_(j, j + 1) += rig_.coupling[j];
      by_angle_(j + 1, j) += rig_.coupling[j];
      by_angle_(j + 1, j + 1) -= rig_.coupling[j];
    }
  }
}

/* Power of the motors and of the dampers; the pushes' and the obstacle's come with the bodies. */
void linearisation::work_rows(const evaluation& e, const double* state) {
  const std::size_t motors = n_ + motor_power, dampers = n_ + damping_power;
  const double* speed = state + layout_.speed();
  for (std::size_t i = 0; i < m_; ++i) {
    const double *arm = &e.arm[i * n_], *arm_slope = &e.arm_slope[i * n_];
    const double motor_speed = state[layout_.motor_speed() + i];
    by_motor_(motors, i) = motor_speed * e.force_by_elongation[i];
    by_motor_speed_(motors, i) = e.force[i] + motor_speed * e.force_by_speed[i];
    // (f − f_elastic) ė: by ė, and by the elongation only while the clipped damper has left the elastic part behind
    const double stretch = e.elongation[i], stretching = e.elongation_speed[i];
    const tendon& tendon = rig_.tendons[i];
    const double elastic = e.modes.slack[i] ? 0.0 : stretch * (tendon.stiffness + tendon.hardening * stretch);
    const double stiffness = e.modes.slack[i] ? 0.0 : tendon.stiffness + 2.0 * tendon.hardening * stretch;
    const double by_speed = e.force[i] - elastic + e.force_by_speed[i] * stretching;
    const double by_stretch = (e.force_by_elongation[i] - stiffness) * stretching;
    by_motor_(dampers, i) = by_stretch;
    by_motor_speed_(dampers, i) = by_speed;
    for (std::size_t k = 0; k < n_; ++k) {
      by_angle_(motors, k) -=
          motor_speed * (e.force_by_elongation[i] * arm[k] + e.force_by_speed[i] * arm_slope[k] * speed[k]);
      by_speed_(motors, k) -= motor_speed * e.force_by_speed[i] * arm[k];
      by_angle_(dampers, k) -= by_stretch * arm[k] + by_speed * arm_slope[k] * speed[k];
      by_speed_(dampers, k) -= by_speed * arm[k];
    }
  }
  for (std::size_t j = 0; j < n_; ++j) {
    const link& link = rig_.links[j];
    by_speed_(dampers, j) += 2.0 * link.damping * speed[j];
    if (!e.modes.below[j] && !e.modes.above[j]) {
      continue;
    }
    const double spring = link.stop_stiffness * ((e.modes.below[j] ? link.lower : link.upper) - state[j]);
    if (e.stop_torque[j] != 0.0) {
      by_speed_(dampers, j) += 2.0 * link.stop_damping * speed[j];
    } else {
      by_speed_(dampers, j) += spring;
      by_angle_(dampers, j) -= link.stop_stiffness * speed[j];
    }
  }
}

/* Power against friction in the wrist, arm α' (f0 − tension after it): a part of the friction power and of the work
 * done on the finger from outside. */
void linearisation::wrist_slopes(const evaluation& e, const double* speed) {
  for (std::size_t i = 0; i < m_; ++i) {
    const std::size_t s = rig_.tendons[i].first_site;
    const double lever = rig_.wrist.arms[i] * e.wrist_speed;
    const double by_force = lever * (1.0 - e.loss_by_force[s]), by_share = -lever * e.loss_by_share[s];
    const double *arm = &e.arm[i * n_], *arm_slope = &e.arm_slope[i * n_];
    const double by_path_speed = by_share * e.responses.share_by_velocity[s] - by_force * e.force_by_speed[i];
    for (const std::size_t row : {n_ + friction_power, n_ + motor_power}) {
      for (std::size_t k = 0; k < n_; ++k) {
        by_speed_(row, k) += by_path_speed * arm[k];
        by_angle_(row, k) += by_path_speed * arm_slope[k] * speed[k] - by_force * e.force_by_elongation[i] * arm[k];
      }
      by_motor_(row, i) += by_force * e.force_by_elongation[i];
      by_motor_speed_(row, i) += by_force * e.force_by_speed[i];
      by_bristle_(row, s) += by_share * e.responses.share_by_bristle[s];
      by_heat_[row] += by_share * e.responses.share_by_level[s] * e.level_by_heat;
    }
  }
}

/* Rigid bodies, pushes and obstacle, differentiated along angles and speeds in groups of `lanes` directions. */
void linearisation::body_slopes(const evaluation& e, const double* state, const commands& inputs) {
  const std::size_t directions = 2 * n_;
  for (std::size_t first = 0; first < directions; first += lanes) {
    slopes angle[max_joints], speed[max_joints], needed[max_joints];
    for (std::size_t j = 0; j < n_; ++j) {
      angle[j] = slopes(state[j]);
      speed[j] = slopes(state[layout_.speed() + j]);
      if (j >= first && j < first + lanes) {
        angle[j].slope[j - first] = 1.0;
      }
      if (n_ + j >= first && n_ + j < first + lanes) {
        speed[j].slope[n_ + j - first] = 1.0;
      }
    }
    chain_motion<slopes> motion;
    move_chain(rig_, angle, speed, &motion);
    const contact_torque<slopes> contact =
        contact_torques(rig_, motion, e.time, inputs.scheduled_pushes, inputs.push, e.modes.touching);
    inverse_dynamics(rig_, motion, speed, e.acceleration, needed);
    for (std::size_t d = first; d < std::min(first + lanes, directions); ++d) {
      const std::size_t lane = d - first;
      auto column = d < n_ ? by_angle_.col(d) : by_speed_.col(d - n_);
      for (std::size_t j = 0; j < n_; ++j) {
        column[j] += contact.torque[j].slope[lane] - needed[j].slope[lane];
      }
      column[n_ + damping_power] += contact.obstacle_loss.slope[lane];
      column[n_ + push_power] += contact.push_power.slope[lane];
    }
  }
}

bool linearisation::factor(double gamma) {
  gamma_ = gamma;
  small reduced(n_ + 1, n_ + 1);
  reduced.setZero();
  reduced.topLeftCorner(n_, n_) = mass_;
  reduced.leftCols(n_) -= gamma * (by_speed_ + gamma * by_angle_).topRows(n_ + 1);
  reduced.col(n_) = -gamma * by_heat_.head(n_ + 1);
  reduced(n_, n_) += 1.0 + gamma * heat_rate_;
  for (std::size_t s = 0; s < k_; ++s) {
    const double factor = 1.0 / (1.0 - gamma * bristle_own_[s]);
    bristle_factor_[s] = factor;
    const double scale = gamma * gamma * factor;
    for (std::size_t k = 0; k < n_; ++k) {
      const double moved = scale * (bristle_by_speed_(s, k) + gamma * bristle_by_angle_(s, k));
      if (moved == 0.0) {
        continue;
      }
      for (std::size_t j = 0; j <= n_; ++j) {
        reduced(j, k) -= by_bristle_(j, s) * moved;
      }
    }
  }
  if (!reduced.allFinite()) {
    return false;
  }
  reduced_.compute(reduced);
  return reduced_.matrixLU().diagonal().cwiseAbs().minCoeff() > 0.0;
}

void linearisation::solve(double* b) const {
  using map = Eigen::Map<Eigen::VectorXd>;
  map angle(b, n_), speed(b + n_, n_), motor(b + 2 * n_, m_), motor_speed(b + 2 * n_ + m_, m_);
  map bristle(b + layout_.bristle(), k_);
  const double g = gamma_;

  // motors: two equations each, of nothing else
  const double determinant = 1.0 + g * (damping_ + g * omega_ * omega_);
  for (std::size_t i = 0; i < m_; ++i) {
    const double faster = (motor_speed[i] - g * omega_ * omega_ * motor[i]) / determinant;
    motor[i] += g * faster;
    motor_speed[i] = faster;
  }
  // speeds and heat: bristles and angles, as far as they are known without the speeds, go to the right
  bristle += g * (bristle_by_angle_ * angle);
  bristle.array() *= bristle_factor_.array();
  const std::size_t rows = n_ + 1;
  small_vector right = g * (by_angle_.topRows(rows) * angle + by_motor_.topRows(rows) * motor +
                            by_motor_speed_.topRows(rows) * motor_speed + by_bristle_.topRows(rows) * bristle);
  right.head(n_) += mass_ * speed;
  right[n_] += b[layout_.heat()];
  right = reduced_.solve(right);
  speed = right.head(n_);
  b[layout_.heat()] = right[n_];
  // back
  const small_vector turned = g * speed;
  bristle.array() += g * bristle_factor_.array() * (bristle_by_speed_ * speed + bristle_by_angle_ * turned).array();
  angle += turned;
  for (std::size_t k = 0; k < powers; ++k) {  // in the order of the works in the state
    const std::size_t row = n_ + order_of_works[k];
    b[layout_.motor_work() + k] +=
        g * (by_angle_.row(row).dot(angle) + by_speed_.row(row).dot(speed) + by_motor_.row(row).dot(motor) +
             by_motor_speed_.row(row).dot(motor_speed) + by_bristle_.row(row).dot(bristle) + by_heat_[row] * right[n_]);
  }
}

}  // namespace tendonfmu::plant
