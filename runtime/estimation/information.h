/* Cost, gradient and information of the model over recordings: one pass over all samples, on all cores, without ever
 * holding the Jacobian.
 *
 * The bias is a random walk seen through white noise, so the innovations of its filter (contract section 5, step 6) are
 * white, and they are linear in the sensitivities: ν = ∂T/∂z − s, s what the bias holds of it. A row of ν has nearly
 * all unknowns in it, a row of ∂T/∂z few. Over a block of samples
 *
 *   ν_i = ν⁰_i − c_i·s,   ν⁰ the same with s = 0 at the block's start,   c_i = Π (1 − K)/√S,
 *   Σ ν_i ν_iᵀ = Σ ν'_i ν'_iᵀ + z zᵀ,   u = Σ c_i ν⁰_i, C = Σ c_i², ν'_i = ν⁰_i − c_i·u/C, z = √C·s − u/√C,
 *
 * which is exact, a sum of squares, and leaves the many rows ν' sparse and one dense row z a block. */
#ifndef TENDONFMU_ESTIMATION_INFORMATION_H
#define TENDONFMU_ESTIMATION_INFORMATION_H

#include <Eigen/Core>
#include <atomic>
#include <functional>

#include "recording_track.h"

namespace tendonfmu::estimation {

/* A finger, its unknowns, its recordings. */
struct Problem {
  Problem(const void* image, std::size_t image_size, const std::int32_t* group, const double* scale);

  std::vector<unsigned char> image;
  FreeFinger finger;
  Unknowns unknowns;
  std::vector<Recording> recordings;

  std::size_t joints() const { return finger.get()->joints; }
  std::size_t samples() const;
};

/* ½ Σ e²/S over all recordings, its derivative, and Σ ν νᵀ. */
struct Evaluation {
  double cost = 0.0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information; /* symmetric, both triangles */
  /* What the cost's second derivative has beyond the information, −Σ e·∂ν/∂z, of the sides of Unknowns::rates():
   * [2·k] by rate and rate, [2·k + 1] by rate and drop. All others are products of small numbers. */
  Eigen::VectorXd second;
  bool complete = false; /* false: stopped */
};

/* Called on the caller's thread now and then; false stops. */
using Watch = std::function<bool(std::size_t samples_done)>;

struct PassOptions {
  std::size_t stride = 1; /* only every stride-th sample, each for `stride` */
  unsigned threads = 0;   /* 0: all cores */
};

/* z [unknowns], within its bounds. The result does not depend on the number of threads. Throws refused. */
Evaluation evaluate(const Problem& problem, const std::vector<double>& z, const PassOptions& options,
                    const Watch& watch);

}  // namespace tendonfmu::estimation

#endif
