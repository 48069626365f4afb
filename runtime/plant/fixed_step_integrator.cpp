#include "fixed_step_integrator.h"

#include <algorithm>
#include <cmath>

#include "sentence.h"

namespace tendonfmu::plant {
namespace {

constexpr int most_iterations = 20;
constexpr int most_divisions = 10;      /* of a step in two */
constexpr double good_progress = 0.1;   // per iteration, else the matrix is taken anew
constexpr double close_enough = 1e-6;   // rad/s, of the speed in the middle of a step
constexpr double longest_change = 2.0;  // rad/s per iteration
constexpr double beyond_reason = 1e6;   // rad, rad/s, m

}  // namespace

fixed_step_integrator::fixed_step_integrator(dynamics* equations, double step)
    : equations_(*equations),
      linearisation_(equations->the_rig()),
      step_(step),
      stops_(push_times(equations->the_rig())) {
  change_.resize(equations->layout().joints);
  for (std::vector<double>* one : {&state_, &middle_, &rate_}) {
    one->resize(equations->layout().size());
  }
  acceleration_.assign(equations->layout().joints, 0.0);
}

void fixed_step_integrator::forget() {
  std::fill(acceleration_.begin(), acceleration_.end(), 0.0);
  factored_for_ = 0.0;
}

/* Motors in the middle of the step: they obey their servo alone, two linear equations each. */
void fixed_step_integrator::move_motors(const commands& inputs, double middle, double half) {
  const state_layout& at = equations_.layout();
  const rig& rig = equations_.the_rig();
  const double omega = 2.0 * pi * rig.servo_frequency, damping = 2.0 * rig.servo_damping * omega;
  double command[max_tendons];
  equations_.command_motors(middle, inputs, command);
  for (std::size_t i = 0; i < at.tendons; ++i) {
    const double x = state_[at.motor() + i], speed = state_[at.motor_speed() + i];
    const double faster =
        (speed + half * omega * omega * (command[i] - x)) / (1.0 + half * (damping + half * omega * omega));
    middle_[at.motor() + i] = x + half * faster;
    middle_[at.motor_speed() + i] = faster;
  }
}

void fixed_step_integrator::place_middle(double half, const double* speed) {
  const state_layout& at = equations_.layout();
  for (std::size_t j = 0; j < at.joints; ++j) {
    middle_[at.speed() + j] = speed[j];
    middle_[at.angle() + j] = state_[at.angle() + j] + half * speed[j];
  }
}

void fixed_step_integrator::evaluate(const commands& inputs, double middle, double half, bool slopes) {
  equations_.want_slopes(slopes);
  equations_.evaluate_after(half, middle, middle_.data(), inputs, rate_.data());
  work_.right_hand_sides += 1;
}

/* The matrix of Newton's method at the present middle, whose slopes were evaluated. */
void fixed_step_integrator::take_matrix(const commands& inputs, double middle, double half) {
  linearisation_.take(equations_, middle_.data(), inputs, rigid_slopes::contact_only);
  work_.jacobians += 1;
  factored_for_ = linearisation_.factor(half) ? half : 0.0;
  factored_at_ = middle;
  factored_state_ = middle_;
}

void fixed_step_integrator::save_memory(double* numbers) const {
  double* next = std::copy(acceleration_.begin(), acceleration_.end(), numbers);
  if (factored_for_ > 0.0) {
    *next++ = factored_for_;
    *next++ = factored_at_;
    std::copy(factored_state_.begin(), factored_state_.end(), next);
  }
}

void fixed_step_integrator::restore_memory(const double* numbers, const commands& inputs) {
  std::copy(numbers, numbers + acceleration_.size(), acceleration_.begin());
  const double half = numbers[acceleration_.size()], middle = numbers[acceleration_.size() + 1];
  factored_for_ = 0.0;
  if (half > 0.0) {
    std::copy_n(numbers + acceleration_.size() + 2, middle_.size(), middle_.begin());
    evaluate(inputs, middle, half, true);
    take_matrix(inputs, middle, half);
  }
}

/* Newton's method for the speeds V in the middle: V = q̇ + half q̈(q + half V, V, bristles moved on by `half` at V). */
bool fixed_step_integrator::find_middle(const commands& inputs, double middle, double half) {
  const state_layout& at = equations_.layout();
  const std::size_t n = at.joints;
  double speed[max_joints];
  for (std::size_t j = 0; j < n; ++j) {
    speed[j] = state_[at.speed() + j] + half * acceleration_[j];
  }
  double before = 0.0;
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    place_middle(half, speed);
    bool fresh = factored_for_ != half;
    evaluate(inputs, middle, half, fresh);
    // the matrix of an earlier step does while it still leads quickly to the end
    double largest = 0.0;
    if (!fresh) {
      largest = change_of_speed(half, speed);
    }
    if (!fresh && iteration > 0 && largest > good_progress * before && largest > close_enough) {
      fresh = true;
      evaluate(inputs, middle, half, true);
    }
    if (fresh) {
      take_matrix(inputs, middle, half);
      if (factored_for_ == 0.0) {
        return false;
      }
      largest = change_of_speed(half, speed);
    }
    if (!(largest < beyond_reason)) {
      return false;
    }
    if (largest < close_enough) {
      if (iteration > 1) {
        factored_for_ = 0.0;  // the next step is better off with its own matrix
      }
      return true;
    }
    before = largest;
    const double scale = std::min(1.0, longest_change / largest);
    for (std::size_t j = 0; j < n; ++j) {
      speed[j] += scale * change_[j];
    }
  }
  return false;
}

/* Newton's correction of the speeds into change_; returns the largest. */
double fixed_step_integrator::change_of_speed(double half, const double* speed) {
  const state_layout& at = equations_.layout();
  for (std::size_t j = 0; j < at.joints; ++j) {
    change_[j] = state_[at.speed() + j] + half * rate_[at.speed() + j] - speed[j];
  }
  linearisation_.solve_speeds(change_.data());
  double largest = 0.0;
  for (std::size_t j = 0; j < at.joints; ++j) {
    largest = std::max(largest, std::fabs(change_[j]));
  }
  return largest;
}

void fixed_step_integrator::step(const commands& inputs, double time, double size, int divisions) {
  const state_layout& at = equations_.layout();
  const double half = 0.5 * size, middle = time + half;
  middle_ = state_;
  move_motors(inputs, middle, half);
  if (!find_middle(inputs, middle, half)) {
    // at a stop Newton's method may jump back and forth across the kink: two shorter steps instead
    forget();
    if (divisions < most_divisions) {
      step(inputs, time, half, divisions + 1);
      step(inputs, middle, half, divisions + 1);
      return;
    }
    throw solver_error(sentence("the fixed-step integrator found no equilibrium at t = ", time, " s with a step of ",
                                size, " s: try a smaller step, or cvode"));
  }
  // from the middle to the end
  for (std::size_t j = 0; j < at.joints; ++j) {
    acceleration_[j] = rate_[at.speed() + j];
    state_[at.angle() + j] += size * middle_[at.speed() + j];
    state_[at.speed() + j] += size * acceleration_[j];
  }
  for (std::size_t i = at.motor(); i < at.bristle(); ++i) {
    state_[i] += 2.0 * (middle_[i] - state_[i]);
  }
  // as much time again: the rest of the way shrinks by the same factor
  const response_columns& bent = equations_.last().responses;
  for (std::size_t s = 0; s < at.bristles; ++s) {
    state_[at.bristle() + s] += half * bent.rate[s] * (1.0 + bent.kept[s]);
  }
  // heat fades by itself, implicitly: it may be gone within a step
  const double fading = half / equations_.the_rig().friction.heat_time, heat = state_[at.heat()];
  state_[at.heat()] = heat + size * rate_[at.heat()] / (1.0 + fading);
  for (std::size_t i = at.motor_work(); i < at.size(); ++i) {
    state_[i] += size * rate_[i];
  }
  work_.steps += 1;
}

void fixed_step_integrator::take_steps(const commands& inputs, double from, double to) {
  const double count = std::max(1.0, std::ceil((to - from) / step_ - 1e-9));
  const double size = (to - from) / count;
  for (double k = 0.0; k < count; ++k) {
    step(inputs, from + k * size, size, 0);
  }
}

void fixed_step_integrator::advance(const commands& inputs, double until, moment* now) {
  const double span = until - now->time;
  if (span <= 0.0) {
    return;
  }
  if (same_moment(now->time, until)) {  // 1/span would overflow in the end
    now->time = until;
    return;
  }
  state_ = now->state;
  double from = now->time;
  auto stop = std::upper_bound(stops_.begin(), stops_.end(), from);
  while (from < until) {
    // equal steps up to where a push begins, is full, lets go or ends
    double to = until;
    if (inputs.scheduled_pushes && stop != stops_.end() && *stop < until) {
      to = *stop++;
    }
    if (!same_moment(from, to)) {
      take_steps(inputs, from, to);
    }
    from = to;
  }
  if (!std::all_of(state_.begin(), state_.end(), [](double x) { return std::isfinite(x); })) {
    forget();
    throw solver_error(sentence("the motion diverges before t = ", until, " s: try a smaller step, or cvode"));
  }
  now->state = state_;
  now->time = until;
  now->modes = equations_.modes_at(state_.data());
}

}  // namespace tendonfmu::plant
