/* What is known of the unknowns before the data: a Gaussian about the start of the description. */
#pragma once

#include <Eigen/Core>
#include <utility>

namespace tendonfmu::estimation {

/* In unknowns divided by their scales; d is how far they are from the start. */
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

}  // namespace tendonfmu::estimation
