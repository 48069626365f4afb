#include "motion.h"

#include <algorithm>
#include <cmath>

namespace tendonfmu::plant {
namespace {

constexpr double aside_angle = 0.15;  // rad
constexpr double aside_share = 0.6;   // of the time to settle; then the finger rests

double smooth_step(double u) {
  return u * u * u * (10.0 + u * (-15.0 + 6.0 * u));
}

void command_of(const rig& rig, const double* angle, double pretension, double* command) {
  for (std::size_t i = 0; i < rig.tendon_count(); ++i) {
    const tendon& tendon = rig.tendons[i];
    double path = 0.0;
    for (std::size_t j = 0; j < rig.joint_count(); ++j) {
      path += path_of(tendon.arms[j], angle[j]);
    }
    command[i] = path + elongation_of(tendon, pretension * rig.null_vector[i]);
  }
}

}  // namespace

double at_time(const knots& knots, double time) {
  const std::vector<double>& t = knots.time;
  if (time <= t.front()) {
    return knots.position.front();
  }
  if (time >= t.back()) {
    return knots.position.back();
  }
  const std::size_t k = static_cast<std::size_t>(std::upper_bound(t.begin(), t.end(), time) - t.begin()) - 1;
  const double h = t[k + 1] - t[k], u = (time - t[k]) / h;
  const double x0 = knots.position[k], x1 = knots.position[k + 1];
  const double v0 = knots.velocity[k] * h, v1 = knots.velocity[k + 1] * h;
  const double a0 = knots.acceleration[k] * h * h, a1 = knots.acceleration[k + 1] * h * h;
  // from the left end: x0 + v0 u + a0 u²/2 + c3 u³ + c4 u⁴ + c5 u⁵
  const double dx = x1 - x0 - v0 - 0.5 * a0, dv = v1 - v0 - a0, da = a1 - a0;
  const double c3 = 10.0 * dx - 4.0 * dv + 0.5 * da;
  const double c4 = -15.0 * dx + 7.0 * dv - da;
  const double c5 = 6.0 * dx - 3.0 * dv + 0.5 * da;
  return x0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
}

double elongation_of(const tendon& tendon, double force) {
  const double k = tendon.stiffness;
  // 2 f/(k + √(k² + 4 h f)): the root of k e + h e² = f, also for h = 0
  return 2.0 * force / (k + std::sqrt(k * k + 4.0 * tendon.hardening * std::max(force, 0.0)));
}

void desired_angles(const rig& rig, double time, double* angle) {
  for (std::size_t j = 0; j < rig.joint_count(); ++j) {
    angle[j] = at_time(rig.motion[j], std::max(time, 0.0));
    if (time >= 0.0) {
      continue;
    }
    const double since = (time + rig.settle) / (aside_share * rig.settle);
    const double away = since <= 0.0 ? 1.0 : since >= 1.0 ? 0.0 : 1.0 - smooth_step(since);
    const double lower = rig.links[j].lower, upper = rig.links[j].upper;
    const double towards_middle = angle[j] > 0.5 * (lower + upper) ? -1.0 : 1.0;
    angle[j] += towards_middle * away * std::min(aside_angle, 0.25 * (upper - lower));
  }
}

void scheduled_command(const rig& rig, double time, double extra, double* command) {
  double angle[max_joints];
  desired_angles(rig, time, angle);
  command_of(rig, angle, at_time(rig.pretension, std::max(time, 0.0)) + extra, command);
}

void hold_command(const rig& rig, double* command) {
  double angle[max_joints];
  desired_angles(rig, 0.0, angle);
  command_of(rig, angle, at_time(rig.pretension, 0.0), command);
}

double push_strength(const push& push, double time) {
  const double since = time - push.start;
  const double left = push.rise + push.hold + push.fall - since;
  if (since <= 0.0 || left <= 0.0) {
    return 0.0;
  }
  if (since < push.rise) {
    return 0.5 * push.force * (1.0 - cosine(pi * since / push.rise));
  }
  if (left < push.fall) {
    return 0.5 * push.force * (1.0 - cosine(pi * left / push.fall));
  }
  return push.force;
}

std::vector<double> push_times(const rig& rig) {
  std::vector<double> times;
  for (const push& push : rig.pushes) {
    double time = push.start;
    times.push_back(time);
    for (const double part : {push.rise, push.hold, push.fall}) {
      times.push_back(time += part);
    }
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

}  // namespace tendonfmu::plant
