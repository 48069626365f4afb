/* The extended Kalman filter of sect. V and VI: unknowns that are nearly constant, a bias per joint that is not.
 *
 *   y_k = T_k(z) + b_k + e_k,   b_k = b_{k−1} + Δb_k(z) + w_k,   e ~ N(0, R_k),   w ~ N(0, drift_variance·Δt)
 *
 * Samples are gathered in blocks that are linearised where they begin and taken in at once. Within a block the walk of
 * the bias and its jumps, with their dependence on z, are kept exactly; what a block costs is only that its later
 * samples are linearised at unknowns up to a block old. A block of 1 is the filter of the textbook.
 *
 * Of the covariance there is only the lower triangle, so it cannot become unsymmetric, and it changes by −W Wᵀ with W
 * from the Cholesky factor of the innovations' covariance: P − K H P loses nine digits in twenty samples here. */
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tendonfmu::estimation {

struct kalman_settings {
  std::size_t unknowns, joints;
  std::size_t block;         /* samples, at least 1 */
  double drift_variance;     /* of the bias, (N·m)²/s */
  double parameter_drift;    /* of the unknowns: variance of z/scale, 1/s */
  std::vector<double> scale; /* [p] expected magnitudes; the state is z/scale */
  std::vector<double> lower; /* [p] bounds of z */
  std::vector<double> upper; /* [p] */
};

/* One sample, linearised where kalman_filter::linearise_at() says. Rows: [n × p] by z. */
struct kalman_sample {
  const double* torque;      /* [n] T, N·m */
  const double* torque_rows; /* ∂T/∂z */
  const double* jump;        /* [n] Δb, N·m; nullptr: none at this sample */
  const double* jump_rows;   /* ∂Δb/∂z; not read without jump */
  const double* measured;    /* [n] y, N·m */
  double step;               /* s since the sample before */
  double noise;              /* R, (N·m)² > 0 */
  bool use;                  /* false: only the walk and the jumps */
};

class kalman_filter {
 public:
  /* z [p] at the start, prior_std: standard deviation of z/scale. */
  kalman_filter(kalman_settings settings, const std::vector<double>& start, double prior_std);

  /* Begins again with the start and the prior, for the same samples once more: from now on they are linearised at what
   * has been found so far. That is a step of Gauss and Newton; the first pass is linearised at unknowns still on their
   * way. */
  void begin_pass();

  /* Where samples are to be linearised: z itself, or what the pass before found. */
  const double* linearise_at() const { return settled_ ? anchor_.data() : z_.data(); }

  /* The bias begins anew at `bias` [n] with `variance`; the rows [n × p] say how it depends on z, and `bias` is for
   * linearise_at(). What was gathered must have been taken in. */
  void start_bias(const double* bias, const double* rows, double variance);

  /* Gathers a sample; at most a block of them. */
  void add(const kalman_sample& sample);
  std::size_t gathered() const { return gathered_; }
  bool full() const { return gathered_ == settings_.block; }

  /* Takes in what was gathered. False, and of no further use, where the innovations' covariance is not positive
   * definite: a number was not finite. Allocates nothing, like add() and start_bias(). */
  bool update();

  /* Of the samples that the last update took in: residuals before each sample itself, with all before it, and their
   * variances; [samples × n]. */
  std::size_t updated() const { return updated_; }
  const double* innovation() const { return innovation_.data(); }
  const double* innovation_variance() const { return innovation_variance_.data(); }

  const double* z() const { return z_.data(); }       /* [p] */
  const double* bias() const { return bias_.data(); } /* [n] N·m */
  double bias_variance(std::size_t joint) const {     /* (N·m)² */
    return covariance_.diagonal()[unknowns() + static_cast<Eigen::Index>(joint)];
  }
  double covariance(std::size_t unknown, std::size_t other) const; /* of z */
  void covariance(double* matrix) const;                           /* [p × p] of z, both triangles */

 private:
  using Index = Eigen::Index;

  Index order() const { return covariance_.rows(); }
  Index unknowns() const { return scale_.size(); }
  Index joints() const { return bias_.size(); }
  Index measured() const { return static_cast<Index>(gathered_) * joints(); }
  bool used(Index row) const { return use_[static_cast<std::size_t>(row / joints())] != 0; }
  void set_prior();
  void find_offset();
  template <typename Slopes>
  void set_row(Index row, const Slopes& slopes);
  /* what a row makes of how far z is from where the samples are linearised */
  double offset(Index row) const { return rows_.row(row).head(unknowns()).dot(offset_); }
  void multiply_rows(Index rows);
  /* the steps of an update; rows: measurements, and joints more where the bias jumped */
  void propagate(Index rows);
  void add_noise();
  /* Cholesky's factorisation, not Eigen's: it keeps every pivot, the variance of a measurement with all before it, and
   * leaves out the rows of samples that are not used. */
  bool factor();
  void find_innovations();
  void whiten();
  void correct();
  void keep_within_bounds();

  using rows_matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  kalman_settings settings_;
  double prior_std_;
  Eigen::VectorXd scale_, lower_, upper_; /* [p] */
  Eigen::VectorXd z_, bias_, start_;
  bool settled_ = false;            /* linearised at the anchor */
  Eigen::VectorXd anchor_, offset_; /* [p]; (z − anchor)/scale while a block is gathered, 0 before a second pass */
  Eigen::MatrixXd covariance_;      /* of (z/scale, b): lower triangle, as products.h has it */
  /* what is gathered; rows of the state's order, samples × joints of them and one more sample's for the jumps */
  std::size_t gathered_ = 0, updated_ = 0;
  bool jumped_ = false;
  double elapsed_ = 0.0; /* s since the block's start */
  Eigen::VectorXd jump_; /* [n], [n × p] sums since the block's start */
  rows_matrix jump_rows_;
  rows_matrix rows_; /* H */
  Eigen::VectorXd residual_, noise_, time_;
  std::vector<unsigned char> use_;
  /* of the update */
  rows_matrix product_;        /* H P, then W */
  rows_matrix inner_;          /* H P Hᵀ, then its Cholesky factor: lower triangle */
  Eigen::VectorXd pivot_;      /* [rows] variance of each measurement with all before it */
  Eigen::VectorXd white_;      /* [rows] L⁻¹ (y − ŷ) */
  Eigen::VectorXd correction_; /* [order] */
  Eigen::VectorXd innovation_, innovation_variance_;
};

}  // namespace tendonfmu::estimation
