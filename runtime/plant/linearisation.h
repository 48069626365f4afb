/* The Jacobian of the differential equations in blocks, and the solution of (I − γ J) x = b by eliminating all that is
 * simple: motors (two by two), bristles (one by one: their block is diagonal, so this is a Schur complement), angles.
 * What is left is one dense system of n speeds and the heat. */
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <vector>

#include "dynamics.h"

namespace tendonfmu::plant {

class linearisation {
 public:
  explicit linearisation(const rig& rig);

  /* Takes the Jacobian at the state that `dynamics` evaluated last. */
  void take(const dynamics& equations, const double* state, const commands& inputs);

  /* Prepares I − γ J. False when it is singular. */
  bool factor(double gamma);

  /* Overwrites b [size] by x. */
  void solve(double* b) const;

 private:
  using matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using vector = Eigen::VectorXd;
  using small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, max_joints + 1, max_joints + 1>;
  using small_vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_joints + 1, 1>;

  void tendon_slopes(const evaluation& e, const double* speed, std::size_t tendon);
  void joint_slopes(const evaluation& e);
  void diagonal_slopes(const evaluation& e, const double* state);
  void power_row(const evaluation& e, const double* speed);
  void wrist_slopes(const evaluation& e, const double* speed);
  void work_rows(const evaluation& e, const double* state);
  void body_slopes(const evaluation& e, const double* state, const commands& inputs);

  const rig& rig_;
  state_layout layout_;
  std::size_t n_, m_, k_;
  double omega_, damping_, heat_rate_;

  // rows 0..n-1: torque on the joints (before the mass matrix); then the powers of friction (which heats), of motors,
  // dampers and pushes
  small mass_;
  matrix by_angle_, by_speed_, by_motor_, by_motor_speed_, by_bristle_;
  vector by_heat_;
  // bristles: own slope, and by angles and speeds [k × n]
  vector bristle_own_;
  matrix bristle_by_angle_, bristle_by_speed_;

  double gamma_ = 0.0;
  vector bristle_factor_; /* 1/(1 − γ own) */
  Eigen::PartialPivLU<small> reduced_;
};

}  // namespace tendonfmu::plant
