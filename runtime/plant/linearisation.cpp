#include "linearisation.h"

#include "elementary.h"

namespace tendonfmu::plant {

linearisation::linearisation(const rig& rig)
    : rig_(rig),
      layout_(rig),
      n_(rig.joint_count()),
      m_(rig.tendon_count()),
      k_(rig.bristle_count()),
      omega_(2.0 * pi * rig.servo_frequency),
      damping_(2.0 * rig.servo_damping * omega_),
      by_angle_(n_, n_),
      by_speed_(n_, n_),
      by_motor_(n_, m_),
      by_motor_speed_(n_, m_),
      by_bristle_(n_, k_),
      bristle_own_(k_),
      bristle_by_speed_(k_, n_) {}

void linearisation::take(const evaluation& e, const double* angle) {
  mass_ = Eigen::Map<const matrix>(e.mass, n_, n_);
  by_angle_.setZero();
  by_speed_.setZero();
  by_bristle_.setZero();
  bristle_by_speed_.setZero();
  for (std::size_t i = 0; i < m_; ++i) {
    tendon_slopes(e, i);
  }
  joint_slopes(e, angle);
  if (e.modes.touching) {
    obstacle_slopes(e);
  }
}

/* What one tendon does. Backward along it: `weight` is the slope of the torque on one joint by the tension that leaves
 * the present site. */
void linearisation::tendon_slopes(const evaluation& e, std::size_t i) {
  const tendon& tendon = rig_.tendons[i];
  const double* arm = &e.arm[i * n_];
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
      const std::size_t s = tendon.first_site + passed - 1;
      const double by_share = weight * e.loss_by_share[s];
      by_bristle_(j, s) = by_share * e.responses.share_by_bristle[s];
      by_velocity[rig_.sites[s].first_mover] += by_share * e.responses.share_by_velocity[s];
      weight *= e.loss_by_force[s];
    }
    // eq. (5) turned round: joint k moves every site whose first mover is not beyond it
    by_motor_(j, i) = weight * e.force_by_elongation[i];
    by_motor_speed_(j, i) = weight * e.force_by_speed[i];
    double total = 0.0;
    for (std::size_t k = 0; k < n_; ++k) {
      total += by_velocity[k];
      by_speed_(j, k) += arm[k] * (total - by_motor_speed_(j, i));
      by_angle_(j, k) -= arm[k] * by_motor_(j, i);
    }
  }
  for (std::size_t s = tendon.first_site; s < tendon.first_site + tendon.site_count; ++s) {
    bristle_own_[s] = e.responses.rate_by_bristle[s];
    for (std::size_t k = rig_.sites[s].first_mover; k < n_; ++k) {
      bristle_by_speed_(s, k) = e.responses.rate_by_velocity[s] * arm[k];
    }
  }
}

/* Friction, covers, couplings, dampers and stops of the joints. */
void linearisation::joint_slopes(const evaluation& e, const double* angle) {
  for (std::size_t s = 0; s < rig_.joint_sites.size(); ++s) {
    const joint_site& site = rig_.joint_sites[s];
    const std::size_t j = site.joint, b = rig_.sites.size() + s;
    const double load = site.by_load ? e.load[j] : 1.0;
    by_bristle_(j, b) = -load * e.responses.share_by_bristle[b];
    by_speed_(j, j) -= load * e.responses.share_by_velocity[b];
    bristle_own_[b] = e.responses.rate_by_bristle[b];
    bristle_by_speed_(b, j) = e.responses.rate_by_velocity[b];
  }
  for (std::size_t j = 0; j < n_; ++j) {
    const link& link = rig_.links[j];
    const double bent = angle[j] - link.cover_rest;
    by_angle_(j, j) -= link.cover_stiffness + 3.0 * link.cover_hardening * bent * bent;
    by_speed_(j, j) -= link.damping;
    if (e.stop_torque[j] != 0.0) {
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

/* Along the normal: torque = turned · strength, growth of the depth = −turned · q̇. */
void linearisation::obstacle_slopes(const evaluation& e) {
  const obstacle& sphere = rig_.obstacle;
  const penetration found = penetrate(sphere, e.motion);
  const double firmness = sphere.stiffness * (1.0 + sphere.damping * found.growth);
  if (firmness < 0.0) {
    return;  // an obstacle does not pull
  }
  small_vector turned = small_vector::Zero(n_);
  add_torque_of_force(e.motion, sphere.link, found.point.place, found.normal, turned.data());
  const small along = turned * turned.transpose();
  by_angle_ -= firmness * along;
  by_speed_ -= sphere.stiffness * found.depth * sphere.damping * along;
}

bool linearisation::factor(double gamma) {
  gamma_ = gamma;
  bristle_factor_ = (1.0 - gamma * bristle_own_.array()).inverse();
  small reduced = mass_ - gamma * (by_speed_ + gamma * by_angle_);
  reduced.noalias() -= by_bristle_ * ((gamma * gamma * bristle_factor_).asDiagonal() * bristle_by_speed_);
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
  motor_speed = (motor_speed - g * omega_ * omega_ * motor) / (1.0 + g * (damping_ + g * omega_ * omega_));
  motor += g * motor_speed;
  // speeds: bristles and angles, as far as they are known without the speeds, go to the right
  bristle.array() *= bristle_factor_.array();
  const small_vector right = mass_ * speed + g * (by_angle_ * angle + by_motor_ * motor +
                                                  by_motor_speed_ * motor_speed + by_bristle_ * bristle);
  speed = reduced_.solve(right);
  // back
  bristle.array() += g * bristle_factor_.array() * (bristle_by_speed_ * speed).array();
  angle += g * speed;
}

}  // namespace tendonfmu::plant
