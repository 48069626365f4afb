/* Steps of one size, linearly implicit: for long series and for clients that change the inputs at every step. */
#ifndef TENDONFMU_PLANT_FIXED_STEP_INTEGRATOR_H
#define TENDONFMU_PLANT_FIXED_STEP_INTEGRATOR_H

#include "integrator.h"
#include "linearisation.h"

namespace tendonfmu::plant {

/* ROS2 of J. G. Verwer, E. J. Spee, J. G. Blom, W. Hundsdorfer, "A second-order Rosenbrock method applied to
 * photochemical dispersion problems", SIAM J. Sci. Comput. 20(4), 1999, with γ = 1 − 1/√2 (L-stable). It keeps order 2
 * with any matrix in place of the Jacobian, so the slopes of the rigid bodies' velocity terms are left out of it. */
class fixed_step_integrator : public integrator {
 public:
  /* step: s; an advance is divided into equal steps of at most that. */
  fixed_step_integrator(dynamics* equations, double step);

  void forget() override {}
  void advance(const commands& inputs, double until, moment* now) override;
  double last_step() const override { return last_step_; }

 private:
  void step(const commands& inputs, double time, double size);

  dynamics& equations_;
  linearisation linearisation_;
  double step_, last_step_ = 0.0;
  std::vector<double> state_, stage_, first_, second_;
};

}  // namespace tendonfmu::plant

#endif
