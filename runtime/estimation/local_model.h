/* The cost around a point, from one pass over the data: exact in the unknowns that enter linearly, to third order in
 * the rates of the laws. */
#pragma once

#include <utility>

#include "information.h"

namespace tendonfmu::estimation {

/* Unknowns divided by their scales, with the box they stay in. */
struct scaled_box {
  explicit scaled_box(const unknown_list& unknowns);

  Eigen::VectorXd scale, start, lower, upper; /* all but scale divided by it */
  std::vector<Eigen::Index> curved;           /* those in which the model is far from linear, such as 1/vs */

  /* the box around x in which a local model is trusted: these change by a share of what they are */
  scaled_box around(const Eigen::VectorXd& x, double share) const;
  Eigen::VectorXd clip(const Eigen::VectorXd& x) const { return x.cwiseMax(lower).cwiseMin(upper); }
  std::vector<double> unknowns(const Eigen::VectorXd& x) const;
};

/* The d of least gᵀd + ½ dᵀHd with lower <= x + d <= upper, H positive semidefinite, x within the box. By an active
 * set: unknowns that would leave the box are held at its side, those that the gradient pulls inwards are let go. */
Eigen::VectorXd boxed_step(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, const Eigen::VectorXd& x,
                           const scaled_box& box);

/* What is known of the unknowns before the data: a Gaussian about the start of the description. In unknowns divided by
 * their scales; d is how far they are from the start. */
struct gaussian_prior {
  /* weight: 1/prior_std²; known: information of an earlier fit [u × u], or empty. Not explicit: a weight is a prior. */
  gaussian_prior(double weight, Eigen::MatrixXd known = {}) : weight(weight), known(std::move(known)) {}

  double cost(const Eigen::VectorXd& d) const {
    const double plain = 0.5 * weight * d.squaredNorm();
    return known.size() > 0 ? plain + 0.5 * d.dot(known * d) : plain;
  }
  Eigen::VectorXd gradient(const Eigen::VectorXd& d) const {
    Eigen::VectorXd found = weight * d;
    if (known.size() > 0) {
      found += known * d;
    }
    return found;
  }
  void add_to(Eigen::MatrixXd* information) const {
    information->diagonal().array() += weight;
    if (known.size() > 0) {
      *information += known;
    }
  }

  double weight;
  Eigen::MatrixXd known;
};

/* In unknowns divided by their scales; the prior is in it. */
class local_model {
 public:
  /* evaluation: at x. All but the prior must outlive the model. */
  local_model(const fit_problem& problem, const scaled_box& box, const cost_evaluation& evaluation,
              const Eigen::VectorXd& x, gaussian_prior prior);

  /* cost of x + step */
  double cost(const Eigen::VectorXd& step) const;
  /* The step of least cost within a box around x, found by Newton's steps on the model alone, each followed by the best
   * of all unknowns but the rates (variable projection, Golub and Pereyra 1973), until one promises less than
   * `negligible` of cost. */
  Eigen::VectorXd best_step(const scaled_box& around, double negligible) const;

 private:
  /* One side of a law with a rate to estimate, in the description's units. */
  struct stribeck_side {
    Eigen::Index rate, drop;                 /* unknowns; drop −1: fixed */
    Eigen::Index rate_column, square_column; /* of the Gram matrix; the cubic one follows the square */
    double at;                               /* drop at x */
    double per_drop;                         /* 1/(at · sides that share the rate), 0 without a drop */
  };

  void linearise(const Eigen::VectorXd& step, Eigen::VectorXd* pull, Eigen::VectorXd* gradient,
                 Eigen::MatrixXd* gauss) const;
  Eigen::VectorXd settled(const Eigen::VectorXd& step, const scaled_box& around) const;
  Eigen::VectorXd weights(const Eigen::VectorXd& step) const;
  Eigen::MatrixXd slopes(const Eigen::MatrixXd& gram, const Eigen::VectorXd& step) const;
  void add_curvature(const Eigen::VectorXd& step, const Eigen::VectorXd& pull, Eigen::MatrixXd* convex,
                     Eigen::MatrixXd* concave) const;
  Eigen::MatrixXd positive(const Eigen::MatrixXd& convex, const Eigen::MatrixXd& concave) const;
  double drop_of(const stribeck_side& side, const Eigen::VectorXd& step) const;

  const fit_problem& problem_;
  const scaled_box& box_;
  const Eigen::MatrixXd& gram_;
  const Eigen::VectorXd& x_;
  gaussian_prior prior_;
  std::vector<stribeck_side> sides_;
};

}  // namespace tendonfmu::estimation
