/* The products that take nearly all the time of an estimation, by Eigen: a sum of outer products of rows, for the
 * information matrix of the batch and the covariance of the filter, rows times a symmetric matrix, and rows among
 * themselves.
 *
 * A symmetric matrix of order p is its lower triangle in [p × p] numbers, column after column: (i, j), i >= j, stands
 * at lower[j·p + i]. What stands above the diagonal is neither read nor written. Rows are row-major, [k × p] with
 * `stride` >= p numbers from row to row.
 *
 * The order of summation depends on the sizes (and in multiply_symmetric on which columns are zero) alone. Any number
 * of threads may call at once; nothing is allocated, up to 200 KiB of stack are used.
 *
 * Compiled twice: for what every processor of the architecture has, and for AVX2 with fused multiply-add. */
#pragma once

#include <cstddef>

namespace tendonfmu::estimation {

struct products {
  const char* name; /* "avx2", or "baseline" */

  /* lower += factor · rowsᵀ · rows */
  void (*add_outer_products)(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride,
                             double factor);

  /* product = rows · (the symmetric matrix), [k × p] with product_stride; columns that are zero in all rows cost
   * nothing. The rows must not overlap with the product. */
  void (*multiply_symmetric)(double* product, std::size_t product_stride, const double* lower, std::size_t p,
                             const double* rows, std::size_t k, std::size_t stride);

  /* product [a × b] = left [a × p] · (right [b × p])ᵀ */
  void (*multiply_transposed)(double* product, std::size_t product_stride, const double* left, std::size_t a,
                              std::size_t left_stride, const double* right, std::size_t b, std::size_t right_stride,
                              std::size_t p);

  /* rows = L⁻¹ · rows, L the lower triangle of factor, row-major */
  void (*solve_lower)(const double* factor, std::size_t factor_stride, double* rows, std::size_t k, std::size_t stride,
                      std::size_t p);
};

extern const products baseline_products;
#if defined(TENDONFMU_ESTIMATION_AVX2)
extern const products avx2_products; /* for processors that have it */
#endif

/* The fastest that runs on this processor. */
const products& best_products();

}  // namespace tendonfmu::estimation
