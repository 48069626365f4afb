#include "linearisation.h"

#include <algorithm>
#include <cmath>

namespace tendonfmu::plant {
namespace {

constexpr int lanes = 8;
using slopes = dual<lanes>;

}  // namespace

void linearisation::gradient::set_zero() {
  by_angle.setZero();
  by_speed.setZero();
  by_motor.setZero();
  by_motor_speed.setZero();
  by_bristle.setZero();
  by_heat = 0.0;
}

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
      by_angle_(n_ + 1, n_),
      by_speed_(n_ + 1, n_),
      by_motor_(n_ + 1, m_),
      by_motor_speed_(n_ + 1, m_),
      by_bristle_(n_ + 1, k_),
      by_heat_(n_ + 1),
      bristle_own_(k_),
      bristle_by_angle_(k_, n_),
      bristle_by_speed_(k_, n_),
      bristle_factor_(k_) {
  for (gradient* one : {&motor_power_, &loss_, &push_power_}) {
    one->by_angle.resize(n_);
    one->by_speed.resize(n_);
    one->by_motor.resize(m_);
    one->by_motor_speed.resize(m_);
    one->by_bristle.resize(k_);
  }
}

void linearisation::take(const dynamics& equations, const double* state, const commands& inputs) {
  const evaluation& e = equations.last();
  const double* speed = state + layout_.speed();
  mass_ = Eigen::Map<const matrix>(e.mass, n_, n_);
  by_angle_.setZero();
  by_speed_.setZero();
  by_heat_.setZero();
  by_bristle_.setZero();
  bristle_by_angle_.setZero();
  bristle_by_speed_.setZero();

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

/* Row n: the power of friction, (torque at the springs − passed torque)ᵀ q̇. */
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
  for (gradient* one : {&motor_power_, &loss_, &push_power_}) {
    one->set_zero();
  }
  const double* speed = state + layout_.speed();
  for (std::size_t i = 0; i < m_; ++i) {
    const double *arm = &e.arm[i * n_], *arm_slope = &e.arm_slope[i * n_];
    const double motor_speed = state[layout_.motor_speed() + i];
    motor_power_.by_motor[i] = motor_speed * e.force_by_elongation[i];
    motor_power_.by_motor_speed[i] = e.force[i] + motor_speed * e.force_by_speed[i];
    // (f − f_elastic) ė: by ė, and by the elongation only while the clipped damper has left the elastic part behind
    const double stretch = e.elongation[i], stretching = e.elongation_speed[i];
    const tendon& tendon = rig_.tendons[i];
    const double elastic = e.modes.slack[i] ? 0.0 : stretch * (tendon.stiffness + tendon.hardening * stretch);
    const double stiffness = e.modes.slack[i] ? 0.0 : tendon.stiffness + 2.0 * tendon.hardening * stretch;
    const double by_speed = e.force[i] - elastic + e.force_by_speed[i] * stretching;
    const double by_stretch = (e.force_by_elongation[i] - stiffness) * stretching;
    loss_.by_motor[i] = by_stretch;
    loss_.by_motor_speed[i] = by_speed;
    for (std::size_t k = 0; k < n_; ++k) {
      motor_power_.by_angle[k] -=
          motor_speed * (e.force_by_elongation[i] * arm[k] + e.force_by_speed[i] * arm_slope[k] * speed[k]);
      motor_power_.by_speed[k] -= motor_speed * e.force_by_speed[i] * arm[k];
      loss_.by_angle[k] -= by_stretch * arm[k] + by_speed * arm_slope[k] * speed[k];
      loss_.by_speed[k] -= by_speed * arm[k];
    }
  }
  for (std::size_t j = 0; j < n_; ++j) {
    const link& link = rig_.links[j];
    loss_.by_speed[j] += 2.0 * link.damping * speed[j];
    if (!e.modes.below[j] && !e.modes.above[j]) {
      continue;
    }
    const double spring = link.stop_stiffness * ((e.modes.below[j] ? link.lower : link.upper) - state[j]);
    if (e.stop_torque[j] != 0.0) {
      loss_.by_speed[j] += 2.0 * link.stop_damping * speed[j];
    } else {
      loss_.by_speed[j] += spring;
      loss_.by_angle[j] -= link.stop_stiffness * speed[j];
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
    const auto add = [&](double& friction, double& outside, double slope) {
      friction += slope;
      outside += slope;
    };
    for (std::size_t k = 0; k < n_; ++k) {
      add(by_speed_(n_, k), motor_power_.by_speed[k], by_path_speed * arm[k]);
      add(by_angle_(n_, k), motor_power_.by_angle[k],
          by_path_speed * arm_slope[k] * speed[k] - by_force * e.force_by_elongation[i] * arm[k]);
    }
    add(by_motor_(n_, i), motor_power_.by_motor[i], by_force * e.force_by_elongation[i]);
    add(by_motor_speed_(n_, i), motor_power_.by_motor_speed[i], by_force * e.force_by_speed[i]);
    add(by_bristle_(n_, s), motor_power_.by_bristle[s], by_share * e.responses.share_by_bristle[s]);
    add(by_heat_[n_], motor_power_.by_heat, by_share * e.responses.share_by_level[s] * e.level_by_heat);
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
      const bool is_angle = d < n_;
      const std::size_t column = is_angle ? d : d - n_, lane = d - first;
      for (std::size_t j = 0; j < n_; ++j) {
        (is_angle ? by_angle_ : by_speed_)(j, column) += contact.torque[j].slope[lane] - needed[j].slope[lane];
      }
      (is_angle ? loss_.by_angle : loss_.by_speed)[column] += contact.obstacle_loss.slope[lane];
      (is_angle ? push_power_.by_angle : push_power_.by_speed)[column] += contact.push_power.slope[lane];
    }
  }
}

bool linearisation::factor(double gamma) {
  gamma_ = gamma;
  small reduced(n_ + 1, n_ + 1);
  reduced.setZero();
  reduced.topLeftCorner(n_, n_) = mass_;
  reduced.leftCols(n_) -= gamma * (by_speed_ + gamma * by_angle_);
  reduced.col(n_) = -gamma * by_heat_;
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
  small_vector right =
      g * (by_angle_ * angle + by_motor_ * motor + by_motor_speed_ * motor_speed + by_bristle_ * bristle);
  right.head(n_) += mass_ * speed;
  right[n_] += b[layout_.heat()];
  right = reduced_.solve(right);
  speed = right.head(n_);
  b[layout_.heat()] = right[n_];
  // back
  const small_vector turned = g * speed;
  bristle.array() += g * bristle_factor_.array() * (bristle_by_speed_ * speed + bristle_by_angle_ * turned).array();
  angle += turned;
  const auto grown = [&](const gradient& one) {
    return g * (one.by_angle.dot(angle) + one.by_speed.dot(speed) + one.by_motor.dot(motor) +
                one.by_motor_speed.dot(motor_speed) + one.by_bristle.dot(bristle) + one.by_heat * right[n_]);
  };
  b[layout_.motor_work()] += grown(motor_power_);
  b[layout_.friction_work()] +=
      g * (by_angle_.row(n_).dot(angle) + by_speed_.row(n_).dot(speed) + by_motor_.row(n_).dot(motor) +
           by_motor_speed_.row(n_).dot(motor_speed) + by_bristle_.row(n_).dot(bristle) + by_heat_[n_] * right[n_]);
  b[layout_.damping_work()] += grown(loss_);
  b[layout_.push_work()] += grown(push_power_);
}

void linearisation::dense(double* jacobian) const {
  const std::size_t size = layout_.size();
  Eigen::Map<matrix> j(jacobian, size, size);
  j.setZero();
  const std::size_t motor = layout_.motor(), motor_speed = layout_.motor_speed(), bristle = layout_.bristle();
  j.block(0, n_, n_, n_).setIdentity();
  const matrix inverse = matrix(mass_).inverse();
  const auto rows = [&](auto target, const auto& block) { target = inverse * block.topRows(n_); };
  rows(j.block(n_, 0, n_, n_), by_angle_);
  rows(j.block(n_, n_, n_, n_), by_speed_);
  rows(j.block(n_, motor, n_, m_), by_motor_);
  rows(j.block(n_, motor_speed, n_, m_), by_motor_speed_);
  rows(j.block(n_, bristle, n_, k_), by_bristle_);
  rows(j.block(n_, layout_.heat(), n_, 1), by_heat_);
  for (std::size_t i = 0; i < m_; ++i) {
    j(motor + i, motor_speed + i) = 1.0;
    j(motor_speed + i, motor + i) = -omega_ * omega_;
    j(motor_speed + i, motor_speed + i) = -damping_;
  }
  j.block(bristle, 0, k_, n_) = bristle_by_angle_;
  j.block(bristle, n_, k_, n_) = bristle_by_speed_;
  for (std::size_t s = 0; s < k_; ++s) {
    j(bristle + s, bristle + s) = bristle_own_[s];
  }
  for (const std::size_t row : {layout_.heat(), layout_.friction_work()}) {
    j.block(row, 0, 1, n_) = by_angle_.row(n_);
    j.block(row, n_, 1, n_) = by_speed_.row(n_);
    j.block(row, motor, 1, m_) = by_motor_.row(n_);
    j.block(row, motor_speed, 1, m_) = by_motor_speed_.row(n_);
    j.block(row, bristle, 1, k_) = by_bristle_.row(n_);
    j(row, layout_.heat()) = by_heat_[n_];
  }
  j(layout_.heat(), layout_.heat()) -= heat_rate_;
  const auto work = [&](std::size_t row, const gradient& one) {
    j.block(row, 0, 1, n_) = one.by_angle.transpose();
    j.block(row, n_, 1, n_) = one.by_speed.transpose();
    j.block(row, motor, 1, m_) = one.by_motor.transpose();
    j.block(row, motor_speed, 1, m_) = one.by_motor_speed.transpose();
    j.block(row, bristle, 1, k_) = one.by_bristle.transpose();
    j(row, layout_.heat()) = one.by_heat;
  };
  work(layout_.motor_work(), motor_power_);
  work(layout_.damping_work(), loss_);
  work(layout_.push_work(), push_power_);
}

}  // namespace tendonfmu::plant
