/* Steps of one size, implicit: for long series, and for clients that change the inputs at every step, which makes
 * CVODE begin anew each time. */
#pragma once

#include "integrator.h"
#include "linearisation.h"

namespace tendonfmu::plant {

/* The implicit midpoint rule of order 2, with the bristles' equations solved exactly for the velocity in the middle of
 * the step: they never overshoot, however far a contact slides in one step. */
class fixed_step_integrator : public integrator {
 public:
  /* step: s; an advance is divided into equal steps of at most that. A step whose equation resists is halved. */
  fixed_step_integrator(dynamics* equations, double step);

  void forget() override;
  void advance(const commands& inputs, double until, moment* now) override;
  void save_memory(double* numbers) const override;
  void restore_memory(const double* numbers, const commands& inputs) override;

 private:
  void take_steps(const commands& inputs, double from, double to);
  void step(const commands& inputs, double time, double size, int divisions);
  void move_motors(const commands& inputs, double middle, double half);
  void evaluate(const commands& inputs, double middle, double half, bool slopes);
  void take_matrix(const commands& inputs, double middle, double half);
  bool find_middle(const commands& inputs, double middle, double half);
  double change_of_speed(double half, const double* speed);
  void place_middle(double half, const double* speed);

  dynamics& equations_;
  linearisation linearisation_;
  double step_;
  std::vector<double> stops_; /* push_times(): steps end there */
  double factored_for_ = 0.0; /* half a step, s; 0: no matrix */
  double factored_at_ = 0.0;  /* s, and the state then */
  std::vector<double> factored_state_;
  std::vector<double> state_, middle_, rate_, change_;
  std::vector<double> acceleration_; /* of the step before: where to look first */
};

}  // namespace tendonfmu::plant
