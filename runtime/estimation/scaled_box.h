/* Unknowns divided by their scales, with the box they stay in, and a Newton step within a box. */
#pragma once

#include <Eigen/Core>

#include "unknowns.h"

namespace tendonfmu::estimation {

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

}  // namespace tendonfmu::estimation
