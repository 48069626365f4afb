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
constexpr double coarse_tolerance = 0.1;      /* standard errors: then all samples are looked at */
constexpr double first_damping = 1e-4;        /* of the diagonal in scaled unknowns */
constexpr double smallest_damping = 1e-10, largest_damping = 1e8;

double prior_weight(double prior_std) {
  return std::isinf(prior_std) ? 0.0 : 1.0 / (prior_std * prior_std);
}

/* Everything in unknowns divided by their scales. */
struct Scaled {
  VectorXd scale, start, lower, upper;

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
    }
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
      descend(coarse, coarse_tolerance);
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

  /* Levenberg-Marquardt on every stride-th sample; true: converged */
  bool descend(std::size_t stride, double tolerance) {
    double damping = first_damping, growth = 2.0;
    if (!look(best_.x, stride, &best_)) {
      return false;
    }
    while (result_.passes < options_.most_passes) {
      MatrixXd h = best_.information;
      h.diagonal() += damping * h.diagonal();
      const VectorXd step = boxed_step(h, best_.gradient, best_.x, box_);
      ++result_.steps;
      if (small(step, tolerance)) {
        return true;
      }
      Point next;
      if (!look(box_.clip(best_.x + step), stride, &next)) {
        return false;
      }
      const double expected = -(best_.gradient.dot(step) + 0.5 * step.dot(best_.information * step));
      const double gained = best_.cost - next.cost;
      const double ratio = gained / std::max(expected, 1e-300);
      if (gained >= 0.0) {
        best_ = std::move(next);
        damping = std::max(smallest_damping, damping * std::max(0.1, 1.0 - std::pow(2.0 * ratio - 1.0, 3.0)));
        growth = 2.0;
      } else {
        damping *= growth;
        growth *= 2.0;
        if (damping > largest_damping) {
          return expected <= 1e-9 * std::fabs(best_.cost); /* rounding is all that is left */
        }
      }
    }
    return false;
  }

  /* every unknown moves by less than tolerance of its standard error; those at a side do not move */
  bool small(const VectorXd& step, double tolerance) const {
    /* in the metric of the information: the step's whole length bounds that of each */
    return step.dot(best_.information * step) <= tolerance * tolerance;
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
