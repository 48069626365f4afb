/* Cost, gradient and information of the model over recordings: one pass over all samples, on all cores, without ever
 * holding the Jacobian.
 *
 * The bias is a random walk seen through white noise, so the innovations of its filter (step 6) are
 * white, and they are linear in the sensitivities: ν = ∂T/∂z − s, s what the bias holds of it. A row of ν has nearly
 * all unknowns in it, a row of ∂T/∂z few. Over a block of samples
 *
 *   ν_i = ν⁰_i − c_i·s,   ν⁰ the same with s = 0 at the block's start,   c_i = Π (1 − K)/√S,
 *   Σ ν_i ν_iᵀ = Σ ν'_i ν'_iᵀ + z zᵀ,   u = Σ c_i ν⁰_i, C = Σ c_i², ν'_i = ν⁰_i − c_i·u/C, z = √C·s − u/√C,
 *
 * which is exact, a sum of squares, and leaves the many rows ν' sparse and one dense row z a block. */
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <functional>

#include "recording_track.h"

namespace tendonfmu::estimation {

/* The columns that a pass sums up: the residual e, the unknowns, and two for every side of a law with a rate to
 * estimate, with which its Stribeck part drop·exp(−v·rate) is known to third order in a change δ of the rate: drop·(E −
 * δ·v·E + δ²/2·v²E − δ³/6·v³E),  E = exp(−v·rate). Sorted by the first joint that they turn: those of joint j are a
 * prefix. */
struct gram_columns {
  explicit gram_columns(const unknown_list& unknowns, std::size_t joints);

  std::size_t count = 1;              /* q; column 0 is the residual */
  std::vector<std::size_t> unknown;   /* [u] */
  std::vector<std::size_t> expansion; /* [rates] v²E, followed by −v³E */
  std::vector<std::size_t> end;       /* [n] of each joint's prefix */
};

/* A finger, its unknowns, its recordings. */
struct fit_problem {
  fit_problem(const void* image, std::size_t image_size, const std::vector<std::int32_t>& group, const numbers& scale);

  std::vector<unsigned char> image;
  free_finger finger;
  unknown_list unknowns;
  gram_columns columns;
  std::vector<recording_track> recordings;
  Eigen::MatrixXd known; /* information [u × u] about the start from before the recordings; empty: none */

  std::size_t joints() const { return finger.get()->joints; }
  std::size_t samples() const;
};

/* ½ Σ w e²/S over all recordings, its derivative, and Σ w ν νᵀ; w the recordings' weights. */
struct cost_evaluation {
  double cost = 0.0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information; /* symmetric, both triangles */
  Eigen::MatrixXd gram;        /* [q × q] of all gram_columns, both triangles */
  bool complete = false;       /* false: stopped */
};

inline numbers copied(const Eigen::MatrixXd& values) {
  return {values.data(), values.data() + values.size()};
}

/* Called on the caller's thread now and then; false stops. */
using pass_watch = std::function<bool(std::size_t samples_done)>;

struct pass_options {
  std::size_t stride = 1; /* only every stride-th sample, each for `stride` */
  unsigned threads = 0;   /* 0: all cores */
  bool expanded = true;   /* false: the columns of the expansion stay 0, which takes a third less time */
};

/* z [unknowns], within its bounds. The result does not depend on the number of threads. Throws std::invalid_argument.
 */
cost_evaluation evaluate(const fit_problem& problem, const std::vector<double>& z, const pass_options& options,
                         const pass_watch& watch);

}  // namespace tendonfmu::estimation
