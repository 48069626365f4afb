/* The products that take nearly all the time of an estimation: a sum of outer products of rows, for the information
 * matrix of the batch and the covariance of the filter, rows times a symmetric matrix, and rows among themselves.
 *
 * A symmetric matrix of order p is its lower triangle in [p × p] numbers, column after column: (i, j), i >= j, stands
 * at lower[j·p + i]. What stands above the diagonal is neither read nor written. Rows are row-major, [k × p] with
 * `stride` >= p numbers from row to row.
 *
 * Deterministic: the order of summation depends on the sizes (and in multiply_symmetric on which columns are zero)
 * alone. Any number of threads may call at once; nothing is allocated, up to 100 KiB of stack are used.
 *
 * Why not Eigen: its products use only the instructions that the library is compiled for, SSE2 on any x86-64, and they
 * skip no column of zeros. On one core with AVX2, p = 476, k = 128, in GFLOP/s: add_outer_products() 34 (avx2), 13
 * (portable), Eigen 13; multiply_symmetric() with 2 of 5 columns not zero 31, 8, Eigen 5. With k = 4, a sample of an
 * index finger: 13, 8, Eigen 7 and 13, 5, Eigen 3. */
#pragma once

#include <cstddef>

namespace tendonfmu::estimation {

/* lower += factor · rowsᵀ · rows */
void add_outer_products(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride,
                        double factor);

/* product = rows · (the symmetric matrix), [k × p] with product_stride; columns that are zero in all rows cost nothing.
 * The rows must not overlap with the product. */
void multiply_symmetric(double* product, std::size_t product_stride, const double* lower, std::size_t p,
                        const double* rows, std::size_t k, std::size_t stride);

/* target [a × p] += factor · weights [a × k] · rows [k × p] */
void add_weighted_rows(double* target, std::size_t target_stride, std::size_t a, const double* weights,
                       std::size_t weight_stride, const double* rows, std::size_t k, std::size_t stride, std::size_t p,
                       double factor);

/* product [a × b] = left [a × p] · (right [b × p])ᵀ; columns that are zero in all of left cost nothing */
void multiply_transposed(double* product, std::size_t product_stride, const double* left, std::size_t a,
                         std::size_t left_stride, const double* right, std::size_t b, std::size_t right_stride,
                         std::size_t p);

/* One implementation: "avx2", which rounds a product and its sum once, or "portable", which rounds twice; `name` NULL
 * ends the list. For the dispatch, and for tests and measurements of each. */
struct symmetric_update {
  const char* name;
  decltype(&tendonfmu::estimation::add_outer_products) add_outer_products;
  decltype(&tendonfmu::estimation::multiply_symmetric) multiply_symmetric;
  decltype(&tendonfmu::estimation::add_weighted_rows) add_weighted_rows;
  decltype(&tendonfmu::estimation::multiply_transposed) multiply_transposed;
};

/* Those that run on this processor, the fastest first; [3], the last one with name NULL. */
const symmetric_update* symmetric_updates();

extern const symmetric_update portable_symmetric_update;
#if defined(TENDONFMU_ESTIMATION_AVX2)
extern const symmetric_update avx2_symmetric_update;
#endif

}  // namespace tendonfmu::estimation
