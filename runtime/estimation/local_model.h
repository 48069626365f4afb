/* The cost around a point, from one pass over the data: exact in the unknowns that enter linearly, to third order in
 * the rates of the laws. */
#ifndef TENDONFMU_ESTIMATION_LOCAL_MODEL_H
#define TENDONFMU_ESTIMATION_LOCAL_MODEL_H

#include "information.h"
#include "prior.h"
#include "scaled_box.h"

namespace tendonfmu::estimation {

/* In unknowns divided by their scales; the prior is in it. */
class LocalModel {
 public:
  /* evaluation: at x. All but the prior must outlive the model. */
  LocalModel(const Problem& problem, const ScaledBox& box, const Evaluation& evaluation, const Eigen::VectorXd& x,
             Prior prior);

  /* cost of x + step */
  double cost(const Eigen::VectorXd& step) const;
  /* The step of least cost within a box around x, found by Newton's steps on the model alone, each followed by the best
   * of all unknowns but the rates (variable projection, Golub and Pereyra 1973), until one promises less than
   * `negligible` of cost. */
  Eigen::VectorXd best_step(const ScaledBox& around, double negligible) const;

 private:
  /* One side of a law with a rate to estimate, in the description's units. */
  struct Stribeck {
    Eigen::Index rate, drop;                              /* unknowns; drop −1: fixed */
    Eigen::Index rate_column, drop_column, square_column; /* of the Gram matrix; the cubic one follows the square */
    double at;                                            /* drop at x */
    double per_drop;                                      /* 1/(at · sides that share the rate), 0 without a drop */
  };

  void linearise(const Eigen::VectorXd& step, Eigen::VectorXd* pull, Eigen::VectorXd* gradient,
                 Eigen::MatrixXd* gauss) const;
  Eigen::VectorXd settled(const Eigen::VectorXd& step, const ScaledBox& around) const;
  Eigen::VectorXd weights(const Eigen::VectorXd& step) const;
  Eigen::MatrixXd slopes(const Eigen::MatrixXd& gram, const Eigen::VectorXd& step) const;
  void add_curvature(const Eigen::VectorXd& step, const Eigen::VectorXd& pull, Eigen::MatrixXd* convex,
                     Eigen::MatrixXd* concave) const;
  Eigen::MatrixXd positive(const Eigen::MatrixXd& convex, const Eigen::MatrixXd& concave) const;
  double drop_of(const Stribeck& side, const Eigen::VectorXd& step) const;

  const Problem& problem_;
  const ScaledBox& box_;
  const Eigen::MatrixXd& gram_;
  const Eigen::VectorXd& x_;
  Prior prior_;
  std::vector<Stribeck> sides_;
};

}  // namespace tendonfmu::estimation

#endif
