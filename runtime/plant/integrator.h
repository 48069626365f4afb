/* What both integrators promise. */
#pragma once

#include <cmath>
#include <limits>
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

/* Whether nothing lies between two times that a step could be told from: an integrator then only sets the clock. */
inline bool same_moment(double time, double until) {
  return until - time <= 1e-15 + 4.0 * std::numeric_limits<double>::epsilon() * std::fabs(until);
}

class integrator {
 public:
  virtual ~integrator() = default;

  /* What it remembers no longer holds: the state, its modes or the inputs have changed from outside. */
  virtual void forget() = 0;

  /* Goes on from a saved state whose last step was this, s. */
  void resume(double last_step) {
    forget();
    last_step_ = last_step;
  }

  /* Moves `now` on to time `until`. Throws solver_error and leaves `now` as it was. */
  virtual void advance(const commands& inputs, double until, moment* now) = 0;

  /* s; 0: none taken yet. */
  double last_step() const { return last_step_; }
  const statistics& work() const { return work_; }
  void clear_work() { work_ = {}; }

 protected:
  statistics work_;
  double last_step_ = 0.0;
};

}  // namespace tendonfmu::plant
