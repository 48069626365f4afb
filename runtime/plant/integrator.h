/* What both integrators promise. */
#ifndef TENDONFMU_PLANT_INTEGRATOR_H
#define TENDONFMU_PLANT_INTEGRATOR_H

#include <stdexcept>
#include <vector>

#include "dynamics.h"

namespace tendonfmu::plant {

/* The integrator gave up: time, cause, what to try. */
struct solver_error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct statistics {
  unsigned long long steps = 0, right_hand_sides = 0, jacobians = 0, roots = 0, restarts = 0;
};

/* A moment of the finger. */
struct moment {
  double time = 0.0;
  std::vector<double> state;
  contact_modes modes;
};

class integrator {
 public:
  virtual ~integrator() = default;

  /* What it remembers no longer holds: the state, its modes or the inputs have changed from outside. */
  virtual void forget() = 0;

  /* Moves `now` on to time `until`. Throws solver_error and leaves `now` as it was. */
  virtual void advance(const commands& inputs, double until, moment* now) = 0;

  /* s; 0: none taken yet. */
  virtual double last_step() const = 0;
  const statistics& work() const { return work_; }
  void clear_work() { work_ = {}; }

 protected:
  statistics work_;
};

}  // namespace tendonfmu::plant

#endif
