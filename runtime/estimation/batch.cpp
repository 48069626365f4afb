#include "batch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "refusal.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t coarse_samples = 40000; /* that a coarse pass looks at, about */
constexpr double coarse_share = 0.3;          /* of √unknowns, in standard errors: then all samples are looked at */
constexpr double first_damping = 1e-4;        /* of the diagonal in scaled unknowns */
constexpr double smallest_damping = 1e-10;
constexpr double first_share = 0.5, largest_share = 2.0, smallest_share = 1e-6; /* of a rate, in a step */

double prior_weight(double prior_std) {
  return std::isinf(prior_std) ? 0.0 : 1.0 / (prior_std * prior_std);
}

/* Everything in unknowns divided by their scales. */
struct Scaled {
  VectorXd scale, start, lower, upper;
  std::vector<Eigen::Index> rates; /* 1/vs: the only unknowns in which the model is far from linear */

  explicit Scaled(const Unknowns& unknowns) {
    const auto p = static_cast<Eigen::Index>(unknowns.count());
    scale.resize(p);
    start.resize(p);
    lower.resize(p);
    upper.resize(p);
    for (Eigen::Index k = 0; k < p; ++k) {
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

  /* the box around x in which the linearisation is trusted: rates change by a share of what they are */
  Scaled around(const VectorXd& x, double share) const {
    Scaled box = *this;
    for (const Eigen::Index k : rates) {
      const double most = share * std::max(x[k], 0.5);
      box.lower[k] = std::max(lower[k], x[k] - most);
      box.upper[k] = std::min(upper[k], x[k] + most);
    }
    return box;
  }

  VectorXd clip(const VectorXd& x) const { return x.cwiseMax(lower).cwiseMin(upper); }
  std::vector<double> unknowns(const VectorXd& x) const {
    std::vector<double> z(static_cast<std::size_t>(x.size()));
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      z[static_cast<std::size_t>(k)] = x[k] * scale[k];
    }
    return z;
  }
};

/* Minimum of gᵀd + ½ dᵀHd within lower <= x + d <= upper, by an active set: unknowns that would leave their box are
 * held at its side, those whose gradient pulls inwards are let go. */
VectorXd boxed_step(const MatrixXd& h, const VectorXd& g, const VectorXd& x, const Scaled& box) {
  const Eigen::Index p = x.size();
  VectorXd step = VectorXd::Zero(p);
  std::vector<bool> held(static_cast<std::size_t>(p), false);
  const auto is_held = [&held](Eigen::Index k) { return held[static_cast<std::size_t>(k)]; };
  for (Eigen::Index k = 0; k < p; ++k) { /* at a side, pulled outwards */
    held[static_cast<std::size_t>(k)] = (x[k] <= box.lower[k] && g[k] > 0.0) || (x[k] >= box.upper[k] && g[k] < 0.0);
  }
  for (int round = 0; round < 50; ++round) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < p; ++k) {
      if (!is_held(k)) {
        free.push_back(k);
      }
    }
    if (free.empty()) {
      break;
    }
    const VectorXd rest = g + h * step; /* with the free ones at 0 */
    VectorXd without = rest;
    for (const Eigen::Index k : free) {
      without -= h.col(k) * step[k];
    }
    const MatrixXd part = h(free, free);
    const VectorXd move = part.llt().solve(-without(free));
    bool inside = true;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Eigen::Index at = free[k];
      const double target = x[at] + move[static_cast<Eigen::Index>(k)];
      step[at] = move[static_cast<Eigen::Index>(k)];
      if (target < box.lower[at] || target > box.upper[at]) {
        step[at] = (target < box.lower[at] ? box.lower[at] : box.upper[at]) - x[at];
        held[static_cast<std::size_t>(at)] = true;
        inside = false;
      }
    }
    if (!inside) {
      continue;
    }
    const VectorXd pull = g + h * step;
    bool released = false;
    for (Eigen::Index k = 0; k < p; ++k) {
      const bool low = x[k] + step[k] <= box.lower[k];
      if (is_held(k) && (low ? pull[k] < -1e-12 : pull[k] > 1e-12) && round < 25) {
        held[static_cast<std::size_t>(k)] = false;
        released = true;
      }
    }
    if (!released) {
      break;
    }
  }
  return step;
}

/* Cost with its prior, and what a step needs, in scaled unknowns. */
struct Point {
  VectorXd x;
  Evaluation data;
  double cost = std::numeric_limits<double>::infinity(), prior_cost = 0.0;
  double projected = std::numeric_limits<double>::infinity(); /* with the best of all unknowns but the rates */
  VectorXd gradient;
  MatrixXd information;
};

class Search {
 public:
  Search(const Problem& problem, const BatchOptions& options, const BatchWatch& watch)
      : problem_(problem), options_(options), watch_(watch), box_(problem.unknowns) {}

  BatchResult run(const std::vector<double>& start) {
    best_.x = box_.clip(
        Eigen::Map<const VectorXd>(start.data(), static_cast<Eigen::Index>(start.size())).cwiseQuotient(box_.scale));
    const std::size_t coarse = coarse_stride();
    if (coarse > 1) {
      descend(coarse, coarse_share * std::sqrt(static_cast<double>(start.size())));
    }
    result_.converged = !result_.stopped && descend(1, options_.tolerance);
    result_.z = box_.unknowns(best_.x);
    result_.cost = best_.cost;
    result_.prior_cost = best_.prior_cost;
    if (best_.data.complete) {
      result_.covariance = posterior_covariance(problem_.unknowns, best_.data.information, options_.prior_std);
    }
    result_.at = std::move(best_.data);
    return std::move(result_);
  }

 private:
  std::size_t coarse_stride() const {
    if (options_.stride > 0) {
      return options_.stride;
    }
    return std::max<std::size_t>(1, problem_.samples() / coarse_samples);
  }

  /* Levenberg-Marquardt on every stride-th sample; true: converged. The model is all but linear in everything except
   * the rates, so a point is judged by the cost that is left with the best of the others, which its information tells
   * (variable projection, Golub and Pereyra 1973): long steps along the curved valley of drop, rate and viscous pass.
   */
  bool descend(std::size_t stride, double tolerance) {
    double damping = first_damping, share = first_share;
    if (!look(best_.x, stride, &best_)) {
      return false;
    }
    while (result_.passes < options_.most_passes) {
      const MatrixXd curvature = curvature_at(best_);
      MatrixXd h = curvature;
      h.diagonal() += damping * best_.information.diagonal();
      const VectorXd step = boxed_step(h, best_.gradient, best_.x, box_.around(best_.x, share));
      ++result_.steps;
      if (step.dot(curvature * step) <= tolerance * tolerance) {
        return true;
      }
      Point next;
      if (!look(box_.clip(best_.x + step), stride, &next)) {
        return false;
      }
      const double expected = -(best_.gradient.dot(step) + 0.5 * step.dot(curvature * step));
      const double hoped = expected - (best_.cost - best_.projected); /* by moving the rates */
      const double ratio = hoped > 1e-6 * expected ? (best_.projected - next.projected) / hoped
                                                   : (best_.cost - next.cost) / std::max(expected, 1e-300);
      if (ratio > 0.0) {
        best_ = std::move(next);
      }
      if (ratio > 0.75) {
        damping = std::max(smallest_damping, 0.1 * damping);
        share = std::min(largest_share, 2.0 * share);
      } else if (ratio < 0.25) {
        damping *= 4.0;
        share *= 0.4;
        if (share < smallest_share) {
          return expected <= 1e-9 * std::fabs(best_.cost); /* rounding is all that is left */
        }
      }
    }
    return false;
  }

  /* The information with the second derivatives of the laws: without them the unknowns that the data hardly tell swing
   * to and fro. What they take away from the curvature is taken as far as it stays positive definite. */
  MatrixXd curvature_at(const Point& point) const {
    MatrixXd convex = point.information, concave = MatrixXd::Zero(convex.rows(), convex.cols());
    const auto& rates = problem_.unknowns.rates();
    for (std::size_t k = 0; k < rates.size(); ++k) {
      const Eigen::Index r = rates[k][0], d = rates[k][1];
      const double rr = point.data.second[static_cast<Eigen::Index>(2 * k)] * box_.scale[r] * box_.scale[r];
      if (d < 0) {
        (rr > 0.0 ? convex : concave)(r, r) += rr;
      } else if (point.x[d] > box_.lower[d]) {
        const double rd = point.data.second[static_cast<Eigen::Index>(2 * k + 1)] * box_.scale[r] * box_.scale[d];
        add_pair(rr, rd, r, d, 1.0, &convex);
        add_pair(rr, rd, r, d, -1.0, &concave);
      }
    }
    for (const double share : {1.0, 0.9, 0.75, 0.5, 0.25}) {
      MatrixXd h = convex + share * concave;
      if (h.llt().info() == Eigen::Success) {
        return h;
      }
    }
    return convex;
  }

  /* adds the part of [rr rd; rd 0] that has the eigenvalue of this sign, λ v vᵀ with v ∝ (λ, rd), |v|² = |λ|·root */
  static void add_pair(double rr, double rd, Eigen::Index r, Eigen::Index d, double sign, MatrixXd* h) {
    const double root = std::hypot(rr, 2.0 * rd), eigenvalue = 0.5 * (rr + sign * root);
    if (eigenvalue * sign <= 0.0) {
      return;
    }
    (*h)(r, r) += sign * eigenvalue * eigenvalue / root;
    (*h)(r, d) += sign * eigenvalue * rd / root;
    (*h)(d, r) += sign * eigenvalue * rd / root;
    (*h)(d, d) += sign * rd * rd / root;
  }

  bool look(const VectorXd& x, std::size_t stride, Point* point) {
    const std::vector<double> z = box_.unknowns(x);
    const Watch watch = [this, stride](std::size_t done) {
      if (!watch_) {
        return true;
      }
      const std::vector<double> best = box_.unknowns(best_.x);
      const double cost = std::isfinite(best_.cost) ? best_.cost : std::numeric_limits<double>::quiet_NaN();
      return watch_({result_.passes + 1, stride, done, problem_.samples(), cost, &best});
    };
    Evaluation found = evaluate(problem_, z, {stride, options_.threads}, watch);
    if (!found.complete) {
      result_.stopped = true;
      return false;
    }
    ++result_.passes;
    const double weight = prior_weight(options_.prior_std);
    const VectorXd away = x - box_.start;
    point->x = x;
    point->prior_cost = 0.5 * weight * away.squaredNorm();
    point->cost = found.cost + point->prior_cost;
    point->gradient = found.gradient.cwiseProduct(box_.scale) + weight * away;
    point->information = box_.scale.asDiagonal() * found.information * box_.scale.asDiagonal();
    point->information.diagonal().array() += weight;
    const VectorXd rest = boxed_step(point->information, point->gradient, x, box_.around(x, 0.0));
    point->projected = point->cost + point->gradient.dot(rest) + 0.5 * rest.dot(point->information * rest);
    point->data = std::move(found);
    return true;
  }

  const Problem& problem_;
  const BatchOptions& options_;
  const BatchWatch& watch_;
  const Scaled box_;
  Point best_;
  BatchResult result_;
};

}  // namespace

MatrixXd posterior_covariance(const Unknowns& unknowns, const MatrixXd& information, double prior_std) {
  const Scaled box(unknowns);
  const double weight = prior_weight(prior_std);
  const Eigen::Index p = information.rows();
  MatrixXd h = box.scale.asDiagonal() * information * box.scale.asDiagonal();
  h.diagonal().array() += weight;
  const Eigen::LDLT<MatrixXd> factor(h);
  const MatrixXd inverse = factor.solve(MatrixXd::Identity(p, p));
  return box.scale.asDiagonal() * (0.5 * (inverse + inverse.transpose())) * box.scale.asDiagonal();
}

BatchResult fit_batch(const Problem& problem, const std::vector<double>& start, const BatchOptions& options,
                      const BatchWatch& watch) {
  if (!(options.prior_std > 0.0)) {
    throw refused("prior_std = " + std::to_string(options.prior_std) + ": expected above 0");
  }
  if (problem.unknowns.count() == 0) {
    throw refused("nothing to estimate: expected at least one number that is not fixed");
  }
  return Search(problem, options, watch).run(start);
}

}  // namespace tendonfmu::estimation
