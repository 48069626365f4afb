#include "fixed_step_integrator.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tendonfmu::plant {
namespace {

const double gamma = 1.0 - std::sqrt(0.5);
constexpr double beyond_reason = 1e6;  // rad, rad/s, m: the step was too long for what happened

}  // namespace

fixed_step_integrator::fixed_step_integrator(dynamics* equations, double step)
    : equations_(*equations), linearisation_(equations->the_rig()), step_(step) {
  for (std::vector<double>* one : {&state_, &stage_, &first_, &second_}) one->resize(equations->layout().size());
}

/*   (I − γhJ) k1 = f(t, y)
 *   (I − γhJ) k2 = f(t + h, y + h k1) − 2 k1
 *   y += h (3/2 k1 + 1/2 k2) */
void fixed_step_integrator::step(const commands& inputs, double time, double size) {
  const std::size_t order = state_.size();
  const contact_modes modes = equations_.modes_at(state_.data());
  equations_.evaluate(time, state_.data(), modes, inputs, first_.data());
  linearisation_.take(equations_, state_.data(), modes, inputs, rigid_slopes::contact_only);
  bool sound = linearisation_.factor(gamma * size);
  if (sound) {
    linearisation_.solve(first_.data());
    for (std::size_t k = 0; k < order; ++k) stage_[k] = state_[k] + size * first_[k];
    equations_.evaluate(time + size, stage_.data(), equations_.modes_at(stage_.data()), inputs, second_.data());
    for (std::size_t k = 0; k < order; ++k) second_[k] -= 2.0 * first_[k];
    linearisation_.solve(second_.data());
    for (std::size_t k = 0; k < order; ++k) state_[k] += size * (1.5 * first_[k] + 0.5 * second_[k]);
    const std::size_t moving = equations_.layout().bristle();
    sound = std::all_of(state_.begin(), state_.begin() + static_cast<std::ptrdiff_t>(moving),
                        [](double x) { return std::fabs(x) < beyond_reason; }) &&
            std::isfinite(state_[equations_.layout().heat()]);
  }
  work_.steps += 1;
  work_.right_hand_sides += 2;
  work_.jacobians += 1;
  if (!sound) {
    char line[160];
    std::snprintf(line, sizeof line,
                  "the fixed-step integrator diverged at t = %.6g s with step %.3g s: try a smaller step, or cvode",
                  time, size);
    throw solver_error(line);
  }
}

void fixed_step_integrator::advance(const commands& inputs, double until, moment* now) {
  const double span = until - now->time;
  if (span <= 0.0) return;
  const double count = std::max(1.0, std::ceil(span / step_ - 1e-9));
  const double size = span / count;
  state_ = now->state;
  for (double k = 0.0; k < count; ++k) step(inputs, now->time + k * size, size);
  last_step_ = size;
  now->state = state_;
  now->time = until;
  now->modes = equations_.modes_at(state_.data());
}

}  // namespace tendonfmu::plant
