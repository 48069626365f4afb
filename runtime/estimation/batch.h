/* All recordings at once: maximum likelihood of the model under a weak Gaussian prior, within the unknowns' boxes. Each
 * pass over the data gives a local model of the cost, whose best step leads to the next. */
#pragma once

#include "information.h"

namespace tendonfmu::estimation {

struct batch_options {
  double prior_std = 1.0; /* of an unknown, in expected magnitudes; infinite: no prior */
  double tolerance = 0.3; /* a step this long ends it: in standard errors, all unknowns together */
  std::size_t most_passes = 60;
  std::size_t stride = 0; /* of the first, coarse passes; 0: chosen by the number of samples */
  unsigned threads = 0;
};

struct batch_progress {
  std::size_t pass, stride, samples_done, samples;
  double cost; /* of the best so far, prior included; NaN before the first pass */
  const std::vector<double>* best;
};
/* false stops */
using batch_watch = std::function<bool(const batch_progress&)>;

struct batch_result {
  std::vector<double> z;
  double cost = 0.0, prior_cost = 0.0;
  cost_evaluation at;         /* at z; over all samples unless stopped in the coarse passes */
  Eigen::MatrixXd covariance; /* (information + prior)^-1; an unknown held by its bound is counted as if it were free */
  std::size_t passes = 0, steps = 0;
  bool converged = false, stopped = false;
};

/* start [unknowns]: where to begin, clipped to the bounds; the prior's mean is the description's start. Throws refused.
 */
batch_result fit_batch(const fit_problem& problem, const std::vector<double>& start, const batch_options& options,
                       const batch_watch& watch);

/* (information + prior)^-1, problem.known included */
Eigen::MatrixXd posterior_covariance(const fit_problem& problem, const Eigen::MatrixXd& information, double prior_std);

}  // namespace tendonfmu::estimation
