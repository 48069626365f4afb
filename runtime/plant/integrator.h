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

/* Of the fixed-step integrator: acceleration [n]; half a step and its middle, s, and the state there, for its matrix.
 */
inline std::size_t memory_size(const state_layout& at) {
  return at.joints + 2 + at.size();
}

/* Whether two times are so close that no step fits between them: an integrator then only sets the clock. */
inline bool same_moment(double time, double until) {
  return until - time <= 1e-15 + 4.0 * std::numeric_limits<double>::epsilon() * std::fabs(until);
}

class integrator {
 public:
  virtual ~integrator() = default;

  /* What it remembers no longer holds: the state, its modes or the inputs have changed from outside. */
  virtual void forget() = 0;

  /* What it remembers beside the moment, for saved states: memory_size() numbers, 0 where nothing is remembered. */
  virtual void save_memory(double*) const {}
  virtual void restore_memory(const double*, const commands&) { forget(); }

  /* Moves `now` on to time `until`. Throws solver_error and leaves `now` as it was. */
  virtual void advance(const commands& inputs, double until, moment* now) = 0;

  const statistics& work() const { return work_; }
  void clear_work() { work_ = {}; }

 protected:
  statistics work_;
};

}  // namespace tendonfmu::plant
