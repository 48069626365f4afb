#include "local_model.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace tendonfmu::estimation {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/* --- steps within bounds --------------------------------------------------------------------------------------------
 */

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

/* --- the model ------------------------------------------------------------------------------------------------------
 */

namespace {

constexpr int most_steps = 25;
constexpr double enough = 0.01; /* of what was gained so far: a step that gains less is the last one */

/* adds the part of [rr rd; rd 0] that has the eigenvalue of this sign, λ v vᵀ with v ∝ (λ, rd), |v|² = |λ|·root */
void add_pair(double rr, double rd, Index r, Index d, double sign, MatrixXd* h) {
  const double root = std::hypot(rr, 2.0 * rd), eigenvalue = 0.5 * (rr + sign * root);
  if (eigenvalue * sign <= 0.0) {
    return;
  }
  (*h)(r, r) += sign * eigenvalue * eigenvalue / root;
  (*h)(r, d) += sign * eigenvalue * rd / root;
  (*h)(d, r) += sign * eigenvalue * rd / root;
  (*h)(d, d) += sign * rd * rd / root;
}

}  // namespace

local_model::local_model(const fit_problem& problem, const scaled_box& box, const cost_evaluation& evaluation,
                         const VectorXd& x, gaussian_prior prior)
    : problem_(problem), box_(box), gram_(evaluation.gram), x_(x), prior_(std::move(prior)) {
  const auto column = [&problem](Index unknown) {
    return static_cast<Index>(problem.columns.unknown[static_cast<std::size_t>(unknown)]);
  };
  const auto& rates = problem.unknowns.rates();
  for (std::size_t k = 0; k < rates.size(); ++k) {
    const Index rate = rates[k][0], drop = rates[k][1];
    const double at = drop < 0 ? problem.unknowns.fixed_drop(k) : x[drop] * box.scale[drop];
    sides_.push_back({rate, drop, column(rate), static_cast<Index>(problem.columns.expansion[k]), at, 0.0});
  } /* −δ·v·E has the drop at x in its column, which sides with one rate share: each stands for its part of it */
  std::vector<double> sharing(static_cast<std::size_t>(x.size()), 0.0);
  for (const stribeck_side& side : sides_) {
    ++sharing[static_cast<std::size_t>(side.rate)];
  }
  for (stribeck_side& side : sides_) {
    side.per_drop = side.at > 0.0 ? 1.0 / (side.at * sharing[static_cast<std::size_t>(side.rate)]) : 0.0;
  }
}

double local_model::drop_of(const stribeck_side& side, const VectorXd& step) const {
  return side.drop < 0 ? side.at : side.at + step[side.drop] * box_.scale[side.drop];
}

/* w with e(x + step) = Σ w·columns: 1 for the residual, minus the change of what stands before each column */
VectorXd local_model::weights(const VectorXd& step) const {
  VectorXd w = VectorXd::Zero(gram_.rows());
  w[0] = 1.0;
  for (Index k = 0; k < step.size(); ++k) {
    w[static_cast<Index>(problem_.columns.unknown[static_cast<std::size_t>(k)])] = -step[k] * box_.scale[k];
  }
  for (const stribeck_side& side : sides_) {
    const double rate = step[side.rate] * box_.scale[side.rate], drop = drop_of(side, step);
    w[side.rate_column] -= rate * (drop - side.at) * side.per_drop;
    w[side.square_column] = -drop * rate * rate / 2.0;
    w[side.square_column + 1] = -drop * rate * rate * rate / 6.0;
  }
  return w;
}

/* matrix · ∂w/∂step, by unknowns divided by their scales */
MatrixXd local_model::slopes(const MatrixXd& matrix, const VectorXd& step) const {
  MatrixXd product(matrix.rows(), step.size());
  for (Index k = 0; k < step.size(); ++k) {
    product.col(k) =
        -box_.scale[k] * matrix.col(static_cast<Index>(problem_.columns.unknown[static_cast<std::size_t>(k)]));
  }
  for (const stribeck_side& side : sides_) {
    const double scale = box_.scale[side.rate], rate = step[side.rate] * scale, drop = drop_of(side, step);
    const auto linear = matrix.col(side.rate_column);
    const auto square = matrix.col(side.square_column), cubic = matrix.col(side.square_column + 1);
    product.col(side.rate) -= scale * drop * rate * (square + rate / 2.0 * cubic);
    product.col(side.rate) -= scale * (drop - side.at) * side.per_drop * linear;
    if (side.drop >= 0) {
      const double by = box_.scale[side.drop];
      product.col(side.drop) -= by * rate * rate * (0.5 * square + rate / 6.0 * cubic);
      product.col(side.drop) -= by * rate * side.per_drop * linear;
    }
  }
  return product;
}

double local_model::cost(const VectorXd& step) const {
  const VectorXd w = weights(step);
  return 0.5 * w.dot(gram_ * w) + prior_.cost(x_ + step - box_.start);
}

/* second derivatives of the weights, times what pulls on them: what makes the cost more convex, and less */
void local_model::add_curvature(const VectorXd& step, const VectorXd& pull, MatrixXd* convex, MatrixXd* concave) const {
  for (const stribeck_side& side : sides_) {
    const double scale = box_.scale[side.rate], rate = step[side.rate] * scale, drop = drop_of(side, step);
    const double square = pull[side.square_column], cubic = pull[side.square_column + 1];
    const double rr = -scale * scale * drop * (square + rate * cubic);
    if (side.drop < 0) {
      (rr > 0.0 ? *convex : *concave)(side.rate, side.rate) += rr;
    } else if (x_[side.drop] + step[side.drop] > box_.lower[side.drop]) {
      const double linear = pull[side.rate_column] * side.per_drop;
      const double rd = -scale * box_.scale[side.drop] * (linear + rate * (square + rate / 2.0 * cubic));
      add_pair(rr, rd, side.rate, side.drop, 1.0, convex);
      add_pair(rr, rd, side.rate, side.drop, -1.0, concave);
    }
  }
}

/* as much of the concave part as leaves the sum positive definite */
MatrixXd local_model::positive(const MatrixXd& convex, const MatrixXd& concave) const {
  for (const double share : {1.0, 0.8, 0.5}) {
    MatrixXd h = convex + share * concave;
    if (h.llt().info() == Eigen::Success) {
      return h;
    }
  }
  return convex;
}

/* gradient and Gauss-Newton matrix of the model, prior included */
void local_model::linearise(const VectorXd& step, VectorXd* pull, VectorXd* gradient, MatrixXd* gauss) const {
  *pull = gram_ * weights(step);
  *gradient = slopes(pull->transpose(), step).transpose() + prior_.gradient(x_ + step - box_.start);
  const MatrixXd half = slopes(slopes(gram_, step).transpose(), step);
  *gauss = 0.5 * (half + half.transpose());
  prior_.add_to(gauss);
}

/* the best of all unknowns but the rates: with these held the model is a parabola */
VectorXd local_model::settled(const VectorXd& step, const scaled_box& around) const {
  const VectorXd at = around.clip(x_ + step);
  VectorXd pull, gradient;
  MatrixXd gauss;
  linearise(at - x_, &pull, &gradient, &gauss);
  return at - x_ + boxed_step(gauss, gradient, at, around.around(at, 0.0));
}

VectorXd local_model::best_step(const scaled_box& around, double negligible) const {
  VectorXd step = settled(VectorXd::Zero(x_.size()), around);
  double least = cost(step), damping = 1e-6;
  const double before = cost(VectorXd::Zero(x_.size()));
  for (int k = 0; k < most_steps; ++k) {
    VectorXd pull, gradient;
    MatrixXd convex, concave = MatrixXd::Zero(step.size(), step.size());
    linearise(step, &pull, &gradient, &convex);
    const VectorXd damped = damping * convex.diagonal();
    add_curvature(step, pull, &convex, &concave);
    convex.diagonal() += damped;
    const MatrixXd curvature = positive(convex, concave);
    const VectorXd change = boxed_step(curvature, gradient, x_ + step, around);
    if (-gradient.dot(change) - 0.5 * change.dot(curvature * change) < negligible) {
      break;
    }
    const VectorXd next = settled(step + change, around);
    const double gained = least - cost(next);
    if (gained > 0.0) {
      step = next;
      least -= gained;
      damping = std::max(1e-12, damping / 10.0);
      if (gained < enough * (before - least)) {
        break;
      }
    } else {
      damping = std::max(1e-4, damping * 10.0);
      if (damping > 1e4) {
        break;
      }
    }
  }
  return step;
}

}  // namespace tendonfmu::estimation
