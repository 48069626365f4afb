#include "batch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "local_model.h"
#include "refusal.h"

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

/* information of unknowns, of unknowns divided by their scales; empty: none */
MatrixXd scaled(const MatrixXd& information, const scaled_box& box) {
  return information.size() > 0 ? MatrixXd(box.scale.asDiagonal() * information * box.scale.asDiagonal()) : MatrixXd();
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
  batch_search(const fit_problem& problem, const batch_options& options, const batch_watch& watch)
      : problem_(problem),
        options_(options),
        watch_(watch),
        box_(problem.unknowns),
        prior_(prior_weight(options.prior_std), scaled(problem.known, box_)) {}

  batch_result run(const std::vector<double>& start) {
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
      result_.covariance = posterior_covariance(problem_, best_.data.information, options_.prior_std);
    }
    result_.at = std::move(best_.data);
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
    const std::vector<double> z = box_.unknowns(x);
    const pass_watch watch = [this, &options](std::size_t done) {
      if (!watch_) {
        return true;
      }
      const std::vector<double> best = box_.unknowns(best_.x);
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

  const fit_problem& problem_;
  const batch_options& options_;
  const batch_watch& watch_;
  const scaled_box box_;
  const gaussian_prior prior_;
  search_point best_;
  batch_result result_;
};

}  // namespace

MatrixXd posterior_covariance(const fit_problem& problem, const MatrixXd& information, double prior_std) {
  const scaled_box box(problem.unknowns);
  /* never nothing: what neither data nor prior know must not come out as known exactly */
  const double weight = std::max(prior_weight(prior_std), least_prior_weight);
  const Eigen::Index p = information.rows();
  MatrixXd h = box.scale.asDiagonal() * information * box.scale.asDiagonal();
  gaussian_prior(weight, scaled(problem.known, box)).add_to(&h);
  const Eigen::LDLT<MatrixXd> factor(h);
  const MatrixXd inverse = factor.solve(MatrixXd::Identity(p, p));
  return box.scale.asDiagonal() * (0.5 * (inverse + inverse.transpose())) * box.scale.asDiagonal();
}

batch_result fit_batch(const fit_problem& problem, const std::vector<double>& start, const batch_options& options,
                       const batch_watch& watch) {
  if (!(options.prior_std > 0.0)) {
    throw refused("prior_std = " + std::to_string(options.prior_std) + ": expected above 0");
  }
  if (problem.unknowns.count() == 0) {
    throw refused("nothing to estimate: expected at least one number that is not fixed");
  }
  return batch_search(problem, options, watch).run(start);
}

}  // namespace tendonfmu::estimation
