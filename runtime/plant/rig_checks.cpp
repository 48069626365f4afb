#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "description_error.h"
#include "dynamics.h"
#include "motion.h"
#include "rig_values.h"

namespace tendonfmu::plant {
namespace {

constexpr double fastest_rate = 2e5;    // 1/s; a sample of 1 kHz sees nothing of it, an integrator all
constexpr double most_friction = 0.95;  // share of the tension that friction along a tendon may take

using matrix = Eigen::MatrixXd;

matrix arms_at(const rig& rig, const double* angle) {
  matrix arms(rig.tendon_count(), rig.joint_count());
  for (std::size_t i = 0; i < rig.tendon_count(); ++i) {
    for (std::size_t j = 0; j < rig.joint_count(); ++j) {
      arms(i, j) = arm_at(rig.tendons[i].arms[j], angle[j]);
    }
  }
  return arms;
}

/* Forces nearest to equal ones that turn no joint: the projection of ones on the null space of Rᵀ. */
void find_null_vector(rig* rig) {
  double angle[max_joints];
  desired_angles(*rig, 0.0, angle);
  const matrix arms = arms_at(*rig, angle);
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(arms.rows());
  const Eigen::ColPivHouseholderQR<matrix> split(arms);
  if (split.rank() < arms.cols()) {
    throw description_error(
        "finger.tendons: expected moment_arms of full column rank (every joint moved by the tendons independently)");
  }
  const Eigen::VectorXd null = ones - arms * split.solve(ones);
  const double mean = null.mean();
  for (Eigen::Index i = 0; i < null.size(); ++i) {
    if (mean > 1e-9 && null[i] > 1e-6 * mean) {
      continue;
    }
    throw description_error(
        "finger.tendons[" + std::to_string(i + 1) +
        "].moment_arms: expected arms with a positive null vector of Rᵀ, forces > 0 of all tendons that turn "
        "no joint: the finger cannot be pretensioned");
  }
  const Eigen::VectorXd scaled = null / mean;
  rig->null_vector.assign(scaled.data(), scaled.data() + scaled.size());
}

void check_start(const json_node& motion, const rig& rig) {
  for (std::size_t j = 0; j < rig.joint_count(); ++j) {
    const double start = rig.motion[j].position.front();
    if (start >= rig.links[j].lower && start <= rig.links[j].upper) {
      continue;
    }
    const std::string range =
        sentence("a start within the joint's limits, ", rig.links[j].lower, " to ", rig.links[j].upper, " rad");
    motion.member("joints").element(j).member("position").element(0).refuse(range);
  }
}

/* Largest break-away level of a site; of a diverted edge within the limits of the joint it depends on. */
double most_of(const rig& rig, const friction_site& site) {
  double most = 0.0;
  for (const law& law : site.friction.laws) {
    most = std::max({most, law.positive.break_away, law.negative.break_away});
  }
  if (site.turn.shape == diversion::form::none) {
    return most;
  }
  const link& bent = rig.links[site.angle_joint];
  law_columns column(1);
  double diverted = 0.0;
  for (int k = 0; k <= 100; ++k) {
    const double angle = bent.lower + 0.01 * k * (bent.upper - bent.lower);
    set_site_law(site, angle, 0.0, rig.friction.stribeck_exponent, 0, &column);
    diverted = std::max(diverted, column.break_away[0]);
  }
  return diverted;
}

void check_friction(const rig& rig) {
  for (std::size_t i = 0; i < rig.tendon_count(); ++i) {
    const tendon& tendon = rig.tendons[i];
    const double grown = 1.0 + std::max(0.0, rig.friction.drift_amplitude);
    double taken = 0.0;
    for (std::size_t s = tendon.first_site; s < tendon.first_site + tendon.site_count; ++s) {
      taken += grown * most_of(rig, rig.sites[s]);
    }
    if (rig.friction.loss == tension_loss::linear && taken > most_friction) {
      throw description_error(sentence("finger.tendons[", i + 1, "]: static friction takes ", taken,
                                       " of the tension on its way; expected less than ", most_friction,
                                       " (or tension_loss \"capstan\")"));
    }
  }
}

/* N·m/rad, of all that holds joint j at the start: tendons, their bristles, its own, stops, cover and coupling. */
double stiffness_of(const rig& rig, const matrix& arms, std::size_t j) {
  const link& link = rig.links[j];
  const double pretension = at_time(rig.pretension, 0.0);
  const double bent = std::max(std::fabs(link.lower - link.cover_rest), std::fabs(link.upper - link.cover_rest));
  double stiffness = link.stop_stiffness + link.cover_stiffness + 3.0 * link.cover_hardening * bent * bent;
  if (j > 0) {
    stiffness += rig.coupling[j - 1];
  }
  if (j + 1 < rig.joint_count()) {
    stiffness += rig.coupling[j];
  }
  for (std::size_t i = 0; i < rig.tendon_count(); ++i) {
    const tendon& tendon = rig.tendons[i];
    const double force = pretension * rig.null_vector[i], arm = arms(i, j);
    double along = tendon.stiffness + 2.0 * tendon.hardening * elongation_of(tendon, force);
    for (std::size_t s = tendon.first_site; s < tendon.first_site + tendon.site_count; ++s) {
      const friction_site& site = rig.sites[s];
      if (site.first_mover <= j) {
        along += force * site.friction.laws.front().break_away * site.inverse_length;
      }
    }
    stiffness += along * arm * arm;
  }
  for (const joint_site& site : rig.joint_sites) {
    const double load = site.by_load ? pretension * static_cast<double>(rig.tendon_count()) : 1.0;
    if (site.joint == j) {
      stiffness += load * site.friction.break_away * site.inverse_length;
    }
  }
  return stiffness;
}

/* Square root of stiffness over inertia of every joint. */
void check_stiffness(const json_node& physics, const rig& rig) {
  const std::size_t n = rig.joint_count();
  double angle[max_joints], rest[max_joints] = {};
  desired_angles(rig, 0.0, angle);
  chain_motion motion;
  move_chain(rig, angle, rest, &motion);
  double mass[max_joints * max_joints];
  mass_matrix(rig, motion, mass);
  const Eigen::MatrixXd inertia = Eigen::Map<Eigen::MatrixXd>(mass, n, n);
  const Eigen::VectorXd least = inertia.inverse().diagonal();  // 1/inertia that a joint alone feels
  if (!least.allFinite() || (least.array() <= 0.0).any()) {
    physics.member("links").refuse("masses and inertias that give every joint a moment of inertia");
  }
  const matrix arms = arms_at(rig, angle);
  for (std::size_t j = 0; j < n; ++j) {
    const double stiffness = stiffness_of(rig, arms, j);
    const double rate = std::sqrt(stiffness * least[j]);
    if (rate <= fastest_rate) {
      continue;
    }
    const std::string said = sentence("a body whose natural frequency on its springs (", stiffness,
                                      " N·m/rad with tendons, presliding, cover, coupling and stops) is below ",
                                      fastest_rate, " rad/s, not ", rate, ": heavier, or less stiff");
    physics.member("links").element(j).refuse(said);
  }
}

}  // namespace

void check_rig(const json_node& document, rig* rig) {
  check_start(document.member("motion"), *rig);
  find_null_vector(rig);
  check_friction(*rig);
  check_stiffness(document.member("physics"), *rig);
}

}  // namespace tendonfmu::plant
