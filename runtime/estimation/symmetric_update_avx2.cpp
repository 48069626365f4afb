/* The products on AVX2 with fused multiply-add. CMake gives this one file the flags; symmetric_update.cpp sees to it
 * that the code is only entered where it can run. */
#include "symmetric_update.h"

#if defined(TENDONFMU_ESTIMATION_AVX2)

#include <immintrin.h>

namespace tendonfmu::estimation {
namespace {

/* 12 sums, 3 factors and 1 spread number: all 16 registers */
constexpr std::size_t lanes = 4, tile_vectors = 3, tile_columns = 4;
using lane_vector = __m256d;

inline __attribute__((always_inline)) lane_vector load(const double* from) {
  return _mm256_loadu_pd(from);
}
inline __attribute__((always_inline)) void store(double* to, lane_vector v) {
  _mm256_storeu_pd(to, v);
}
inline __attribute__((always_inline)) lane_vector spread(double x) {
  return _mm256_set1_pd(x);
}
inline __attribute__((always_inline)) lane_vector multiply_add(lane_vector a, lane_vector b, lane_vector c) {
  return _mm256_fmadd_pd(a, b, c);
}

}  // namespace
}  // namespace tendonfmu::estimation

#define TENDONFMU_OWN_LANES
#include "symmetric_update_kernel.h"

namespace tendonfmu::estimation {

const symmetric_update avx2_symmetric_update = {"avx2", add_products, multiply_rows, mix_rows, multiply_by_rows};

}  // namespace tendonfmu::estimation

#endif
