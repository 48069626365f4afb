/* What is stiff in the Jacobian J of the differential equations, in blocks: tendons, their friction and its bristles,
 * stops, covers, obstacle; and the solution of (I − γ J) x = b. Newton's iteration converges without the rest: gravity
 * and velocity terms, how arms and friction change with the posture, heat and works. Motors (two by two) and bristles
 * (one by one) are eliminated; what is left is one dense system of the n speeds. */
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

#include "dynamics.h"

namespace tendonfmu::plant {

class linearisation {
 public:
  explicit linearisation(const rig& rig);

  /* Takes J at the angles [n] where `dynamics` evaluated last, with slopes. */
  void take(const evaluation& e, const double* angle);

  /* Prepares I − γ J. False when it is singular. */
  bool factor(double gamma);

  /* Overwrites b [size] by x. */
  void solve(double* b) const;

 private:
  using matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using vector = Eigen::VectorXd;
  using small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, max_joints, max_joints>;
  using small_vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_joints, 1>;

  void tendon_slopes(const evaluation& e, std::size_t tendon);
  void joint_slopes(const evaluation& e, const double* angle);
  void obstacle_slopes(const evaluation& e);

  const rig& rig_;
  state_layout layout_;
  std::size_t n_, m_, k_;
  double omega_, damping_;

  // torque on the joints, before the mass matrix
  small mass_, by_angle_, by_speed_;
  matrix by_motor_, by_motor_speed_, by_bristle_;
  // bristles: own slope, and by speeds [k × n]
  vector bristle_own_;
  matrix bristle_by_speed_;

  double gamma_ = 0.0;
  vector bristle_factor_; /* 1/(1 − γ own) */
  Eigen::PartialPivLU<small> reduced_;
};

}  // namespace tendonfmu::plant
