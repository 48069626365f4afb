/* All recordings at once: maximum likelihood of the model under a weak Gaussian prior, within the unknowns' boxes. Each
 * pass over the data gives a local model of the cost, whose best step leads to the next. */
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "local_model.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t coarse_samples = 40000; /* that a coarse pass looks at, about */
constexpr double coarse_share = 0.3;          /* of √unknowns, in standard errors: then all samples are looked at */
constexpr double largest_share = 0.8, smallest_share = 1e-4; /* of a rate, in a step; beyond, its model is not good */
constexpr double plain_gain = 100.0; /* of what ends the search: after a step that promises less, Gauss and Newton's
                                      * parabola, without the expansion of the rates, decides whether it was the last */

constexpr double least_prior_weight = 1e-10; /* of a covariance: standard deviations up to 1e5 scales */

double prior_weight(double prior_std) {
  return std::isinf(prior_std) ? 0.0 : 1.0 / (prior_std * prior_std);
}

/* a matrix of the unknowns with both sides multiplied by their scales; empty: none */
MatrixXd scaled(const MatrixXd& matrix, const scaled_box& box) {
  return matrix.size() > 0 ? MatrixXd(box.scale.asDiagonal() * matrix * box.scale.asDiagonal()) : MatrixXd();
}

/* A point and what a pass over the data found there. */
struct search_point {
  VectorXd x;
  cost_evaluation data;
  double cost = std::numeric_limits<double>::infinity(), prior_cost = 0.0;
  bool expanded = false; /* the data know the rates to third order */
};

class batch_search {
 public:
  batch_search(const fit_problem& problem, const fit_options& options, const fit_watch& watch)
      : problem_(problem),
        options_(options),
        watch_(watch),
        box_(problem.unknowns),
        prior_(prior_weight(options.prior_std), scaled(problem.known, box_)) {}

  fit_result run(const numbers& start) {
    best_.x = box_.clip(
        Eigen::Map<const VectorXd>(start.data(), static_cast<Eigen::Index>(start.size())).cwiseQuotient(box_.scale));
    const std::size_t coarse =
        options_.stride > 0 ? options_.stride : std::max<std::size_t>(1, problem_.samples() / coarse_samples);
    if (coarse > 1) {
      descend(best_.x, coarse, coarse_share * std::sqrt(static_cast<double>(start.size())));
    }
    const VectorXd near = approach(best_.x, static_cast<std::size_t>(std::sqrt(static_cast<double>(coarse))));
    result_.converged = !result_.stopped && descend(near, 1, options_.tolerance);
    result_.z = box_.unknowns(best_.x);
    result_.cost = best_.cost;
    result_.prior_cost = best_.prior_cost;
    if (best_.data.complete) {
      result_.gradient = copied(best_.data.gradient);
      result_.information = copied(best_.data.information);
      result_.covariance = copied(covariance());
    }
    return std::move(result_);
  }

 private:
  /* From x to where all samples are first looked at: one step of the model of every stride-th sample. What it is worth,
   * the pass over all of them decides. */
  VectorXd approach(const VectorXd& x, std::size_t stride) {
    search_point here;
    if (stride < 2 || result_.stopped || result_.passes >= options_.most_passes ||
        !look(x, {stride, options_.threads}, &here)) {
      return x;
    }
    const local_model model(problem_, box_, here.data, x, prior_);
    ++result_.steps;
    return box_.clip(x + model.best_step(box_.around(x, largest_share), 1.0));
  }

  /* On every stride-th sample, from a point: a pass over the data, the best step of the local model that it
   * gives, a pass there. True: converged. */
  bool descend(const VectorXd& from, std::size_t stride, double tolerance) {
    const double enough = 0.5 * tolerance * tolerance;
    double share = largest_share;
    search_point here; /* the costs so far are of another number of samples */
    if (!look(from, {stride, options_.threads}, &here)) {
      return false;
    }
    best_ = std::move(here);
    while (result_.passes < options_.most_passes) {
      const local_model model(problem_, box_, best_.data, best_.x, prior_);
      const VectorXd step = model.best_step(box_.around(best_.x, share), 0.1 * enough);
      const double expected = best_.cost - model.cost(step);
      ++result_.steps;
      if (expected <= enough) {
        return true;
      }
      search_point next;
      const bool expanded = expected > plain_gain * enough || !best_.expanded;
      if (!look(box_.clip(best_.x + step), {stride, options_.threads, expanded}, &next)) {
        return false;
      }
      const double ratio = (best_.cost - next.cost) / expected;
      if (ratio > 0.0) {
        best_ = std::move(next);
      }
      if (ratio > 0.75) {
        share = std::min(largest_share, 1.5 * share);
      } else if (ratio < 0.25) {
        share *= 0.3;
        if (share < smallest_share) { /* rounding is all that is left */
          return expected <= 1e-9 * std::max(1.0, std::fabs(best_.cost));
        }
      }
    }
    return false;
  }

  bool look(const VectorXd& x, const pass_options& options, search_point* point) {
    const numbers z = box_.unknowns(x);
    const pass_watch watch = [this, &options](std::size_t done) {
      if (!watch_) {
        return true;
      }
      const numbers best = box_.unknowns(best_.x);
      const double cost = std::isfinite(best_.cost) ? best_.cost : std::numeric_limits<double>::quiet_NaN();
      return watch_({result_.passes + 1, options.stride, done, problem_.samples(), cost, &best});
    };
    cost_evaluation found = evaluate(problem_, z, options, watch);
    if (!found.complete) {
      result_.stopped = true;
      return false;
    }
    ++result_.passes;
    point->x = x;
    point->prior_cost = prior_.cost(x - box_.start);
    point->cost = found.cost + point->prior_cost;
    point->data = std::move(found);
    point->expanded = options.expanded;
    return true;
  }

  /* (information + prior)^-1, what is known from before included */
  MatrixXd covariance() const {
    /* never nothing: what neither data nor prior know must not come out as known exactly */
    const double weight = std::max(prior_.weight, least_prior_weight);
    const Eigen::Index p = box_.scale.size();
    MatrixXd h = scaled(best_.data.information, box_);
    gaussian_prior(weight, prior_.known).add_to(&h);
    const Eigen::LDLT<MatrixXd> factor(h);
    const MatrixXd inverse = factor.solve(MatrixXd::Identity(p, p));
    return scaled(0.5 * (inverse + inverse.transpose()), box_);
  }

  const fit_problem& problem_;
  const fit_options& options_;
  const fit_watch& watch_;
  const scaled_box box_;
  const gaussian_prior prior_;
  search_point best_;
  fit_result result_;
};

}  // namespace

fit_result estimator::fit(const numbers& start, const fit_options& options, const fit_watch& watch) const {
  expect_length(start.size(), unknowns().size(), "z", "unknowns");
  for (std::size_t k = 0; k < start.size(); ++k) {
    if (std::isnan(start[k])) {
      throw std::invalid_argument("unknown " + std::to_string(k) + " (" + unknowns()[k].path +
                                  ") = nan: expected a finite number");
    }
  }
  if (!(options.prior_std > 0.0)) {
    throw std::invalid_argument("prior_std = " + std::to_string(options.prior_std) + ": expected above 0");
  }
  if (start.empty()) {
    throw std::invalid_argument("nothing to estimate: expected at least one number that is not fixed");
  }
  return batch_search(*problem_, options, watch).run(start);
}

}  // namespace tendonfmu::estimation
