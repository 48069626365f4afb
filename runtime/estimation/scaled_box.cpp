#include "scaled_box.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace tendonfmu::estimation {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ScaledBox::ScaledBox(const Unknowns& unknowns) {
  const auto p = static_cast<Index>(unknowns.count());
  scale.resize(p);
  start.resize(p);
  lower.resize(p);
  upper.resize(p);
  for (Index k = 0; k < p; ++k) {
    const Unknown& u = unknowns[static_cast<std::size_t>(k)];
    scale[k] = u.scale;
    start[k] = u.start / u.scale;
    lower[k] = u.lower / u.scale;
    upper[k] = u.upper / u.scale;
    if (u.role == Role::rate) {
      rates.push_back(k);
    }
  }
}

ScaledBox ScaledBox::around(const VectorXd& x, double share) const {
  ScaledBox box = *this;
  for (const Index k : rates) {
    const double most = share * std::max(x[k], 0.5);
    box.lower[k] = std::max(lower[k], x[k] - most);
    box.upper[k] = std::min(upper[k], x[k] + most);
  }
  return box;
}

std::vector<double> ScaledBox::unknowns(const VectorXd& x) const {
  std::vector<double> z(static_cast<std::size_t>(x.size()));
  for (Index k = 0; k < x.size(); ++k) {
    z[static_cast<std::size_t>(k)] = x[k] * scale[k];
  }
  return z;
}

namespace {

constexpr int most_rounds = 60, last_release = 30; /* of the active set; releases end, so that it ends */

struct ActiveSet {
  const MatrixXd& h;
  const VectorXd &g, &x;
  const ScaledBox& box;
  VectorXd step;
  std::vector<bool> held;

  bool at_lower(Index k) const { return x[k] + step[k] <= box.lower[k]; }
  bool at_upper(Index k) const { return x[k] + step[k] >= box.upper[k]; }
  bool is_held(Index k) const { return held[static_cast<std::size_t>(k)]; }
  void hold(Index k, bool value) { held[static_cast<std::size_t>(k)] = value; }

  /* moves those that are not held to their best; false: some would leave the box, and are held at its side */
  bool move_free() {
    std::vector<Index> free, fixed;
    for (Index k = 0; k < x.size(); ++k) {
      (is_held(k) ? fixed : free).push_back(k);
    }
    if (free.empty()) {
      return true;
    }
    VectorXd pull = g(free);
    if (!fixed.empty()) {
      pull += h(free, fixed) * step(fixed);
    }
    const VectorXd move = h(free, free).llt().solve(-pull);
    bool inside = true;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Index at = free[k];
      const double to = x[at] + move[static_cast<Index>(k)];
      const double clipped = std::min(std::max(to, box.lower[at]), box.upper[at]);
      step[at] = clipped == to ? move[static_cast<Index>(k)] : clipped - x[at];
      if (clipped != to) {
        hold(at, true);
        inside = false;
      }
    }
    return inside;
  }

  /* lets go what is pulled inwards; true: something was */
  bool release() {
    const VectorXd pull = g + h * step;
    bool released = false;
    for (Index k = 0; k < x.size(); ++k) {
      const bool inwards = (at_lower(k) && pull[k] < -1e-12) || (at_upper(k) && pull[k] > 1e-12);
      if (is_held(k) && inwards && box.lower[k] < box.upper[k]) {
        hold(k, false);
        released = true;
      }
    }
    return released;
  }
};

}  // namespace

VectorXd boxed_step(const MatrixXd& h, const VectorXd& g, const VectorXd& x, const ScaledBox& box) {
  ActiveSet set{h, g, x, box, VectorXd::Zero(x.size()), std::vector<bool>(static_cast<std::size_t>(x.size()))};
  for (Index k = 0; k < x.size(); ++k) {
    set.hold(k, (set.at_lower(k) && g[k] > 0.0) || (set.at_upper(k) && g[k] < 0.0) || !(box.lower[k] < box.upper[k]));
  }
  for (int round = 0; round < most_rounds; ++round) {
    if (set.move_free() && (round >= last_release || !set.release())) {
      break;
    }
  }
  return set.step;
}

}  // namespace tendonfmu::estimation
