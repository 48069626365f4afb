#include "scaled_box.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace tendonfmu::estimation {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

scaled_box::scaled_box(const unknown_list& unknowns) {
  const auto p = static_cast<Index>(unknowns.count());
  scale.resize(p);
  start.resize(p);
  lower.resize(p);
  upper.resize(p);
  for (Index k = 0; k < p; ++k) {
    const unknown_item& u = unknowns[static_cast<std::size_t>(k)];
    scale[k] = u.scale;
    start[k] = u.start / u.scale;
    lower[k] = u.lower / u.scale;
    upper[k] = u.upper / u.scale;
    if (u.curved) {
      curved.push_back(k);
    }
  }
}

scaled_box scaled_box::around(const VectorXd& x, double share) const {
  scaled_box box = *this;
  for (const Index k : curved) {
    const double most = share * std::max(std::fabs(x[k]), 0.5);
    box.lower[k] = std::max(lower[k], x[k] - most);
    box.upper[k] = std::min(upper[k], x[k] + most);
  }
  return box;
}

std::vector<double> scaled_box::unknowns(const VectorXd& x) const {
  const VectorXd z = x.cwiseProduct(scale);
  return {z.data(), z.data() + z.size()};
}

namespace {

constexpr int most_rounds = 40;         /* of whole sets; most end after a few */
constexpr int most_single_rounds = 500; /* of one unknown each */

/* of h; where a combination that nothing shows leaves it singular, of one a rounding larger */
Eigen::LLT<MatrixXd> factored(MatrixXd h) {
  Eigen::LLT<MatrixXd> factor(h);
  double more = 1e-14 * h.diagonal().cwiseAbs().maxCoeff();
  for (int k = 0; factor.info() != Eigen::Success && k < 12; ++k, more *= 10.0) {
    h.diagonal().array() += more > 0.0 ? more : 1.0;
    factor.compute(h);
  }
  return factor;
}

struct active_set {
  const MatrixXd& h;
  const VectorXd &g, &x;
  const scaled_box& box;
  VectorXd step;
  std::vector<int> side; /* at which an unknown is held: −1 lower, 1 upper; 0 free */

  active_set(const MatrixXd& h, const VectorXd& g, const VectorXd& x, const scaled_box& box)
      : h(h), g(g), x(x), box(box), step(VectorXd::Zero(x.size())), side(static_cast<std::size_t>(x.size())) {
    for (Index k = 0; k < x.size(); ++k) {
      if ((x[k] <= box.lower[k] && g[k] > 0.0) || !(box.lower[k] < box.upper[k])) {
        held(k) = -1;
      } else if (x[k] >= box.upper[k] && g[k] < 0.0) {
        held(k) = 1;
      }
    }
  }

  int& held(Index k) { return side[static_cast<std::size_t>(k)]; }

  double value() const { return g.dot(step) + 0.5 * step.dot(h * step); }

  /* how those that are not held move to their best with the others where they are */
  VectorXd move(std::vector<Index>* free) {
    for (Index k = 0; k < x.size(); ++k) {
      if (held(k) == 0) {
        free->push_back(k);
      }
    }
    const VectorXd pull = g + h * step;
    return free->empty() ? VectorXd() : VectorXd(factored(h(*free, *free)).solve(-pull(*free)));
  }

  /* moves the free ones; false: some would leave the box, and all of them are held at its side */
  bool move_all() {
    std::vector<Index> free;
    const VectorXd by = move(&free);
    bool inside = true;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Index at = free[k];
      const double to = x[at] + step[at] + by[static_cast<Index>(k)];
      if (to < box.lower[at] || to > box.upper[at]) {
        held(at) = to < box.lower[at] ? -1 : 1;
        step[at] = (to < box.lower[at] ? box.lower[at] : box.upper[at]) - x[at];
        inside = false;
      } else {
        step[at] += by[static_cast<Index>(k)];
      }
    }
    return inside;
  }

  /* moves the free ones until the first meets its side, and holds that one; false: one did */
  bool move_to_first() {
    std::vector<Index> free;
    const VectorXd by = move(&free);
    double share = 1.0;
    Index first = -1;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Index at = free[k];
      const double way = by[static_cast<Index>(k)];
      const double room = (way < 0.0 ? box.lower[at] : box.upper[at]) - x[at] - step[at];
      if (std::fabs(way) * share > std::fabs(room)) {
        share = std::fabs(room / way);
        first = at;
      }
    }
    for (std::size_t k = 0; k < free.size(); ++k) {
      const double way = by[static_cast<Index>(k)];
      step[free[k]] += share * way;
      if (free[k] == first) {
        held(first) = way < 0.0 ? -1 : 1;
        step[first] = (way < 0.0 ? box.lower[first] : box.upper[first]) - x[first];
      }
    }
    return first < 0;
  }

  /* lets go what is pulled inwards, all of it or only the one that gains the most; true: something was */
  bool release(bool all) {
    const VectorXd pull = g + h * step;
    /* rounding of a pull that is none must not let go */
    const double negligible = 1e-12 * std::max(1.0, std::fabs(0.5 * step.dot(g + pull)));
    Index best = -1;
    double most = 0.0;
    bool released = false;
    for (Index k = 0; k < x.size(); ++k) {
      const double inwards = held(k) * pull[k], gain = inwards * inwards / std::max(h(k, k), 1e-300);
      if (inwards > 0.0 && gain > negligible && box.lower[k] < box.upper[k]) {
        released = true;
        if (all) {
          held(k) = 0;
        } else if (gain > most) {
          most = gain;
          best = k;
        }
      }
    }
    if (best >= 0) {
      held(best) = 0;
    }
    return released;
  }

  /* whole sets at a time: fast, and may go round in circles. False: it does. */
  bool settle_quickly() {
    for (int round = 0; round < most_rounds; ++round) {
      if (move_all() && !release(true)) {
        return true;
      }
    }
    return false;
  }

  /* one at a time: no move goes uphill, so that it ends */
  void settle_surely() {
    for (int round = 0; round < most_single_rounds; ++round) {
      if (move_to_first() && !release(false)) {
        return;
      }
    }
  }
};

}  // namespace

VectorXd boxed_step(const MatrixXd& h, const VectorXd& g, const VectorXd& x, const scaled_box& box) {
  active_set set(h, g, x, box);
  if (set.settle_quickly()) {
    return set.step;
  }
  if (!(set.value() < 0.0)) { /* worse than not to move */
    active_set anew(h, g, x, box);
    anew.settle_surely();
    return anew.step;
  }
  set.settle_surely();
  return set.step;
}

}  // namespace tendonfmu::estimation
