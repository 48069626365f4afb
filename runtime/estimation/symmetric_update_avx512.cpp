/* The products on AVX-512. The pragmas stand for -mavx512f; symmetric_update.cpp sees to it that the code is only
 * entered where it can run. The same bits as on AVX2: an element is summed in the same order, each product rounded
 * once. */
#include "symmetric_update.h"

#if defined(TENDONFMU_ESTIMATION_AVX2)

#include <immintrin.h>

namespace tendonfmu::estimation {
namespace {

/* 24 sums and 3 factors of 32 registers */
constexpr std::size_t lanes = 8, tile_vectors = 3, tile_columns = 8;
using lane_vector = __m512d;

inline __attribute__((always_inline)) lane_vector load(const double* from) {
  return _mm512_loadu_pd(from);
}
inline __attribute__((always_inline)) void store(double* to, lane_vector v) {
  _mm512_storeu_pd(to, v);
}
inline __attribute__((always_inline)) lane_vector spread(double x) {
  return _mm512_set1_pd(x);
}
inline __attribute__((always_inline)) lane_vector multiply_add(lane_vector a, lane_vector b, lane_vector c) {
  return _mm512_fmadd_pd(a, b, c);
}

}  // namespace
}  // namespace tendonfmu::estimation

#define TENDONFMU_OWN_LANES
#include "symmetric_update_kernel.h"

namespace tendonfmu::estimation {

const symmetric_update avx512_symmetric_update = {"avx512", add_products, multiply_rows, mix_rows, multiply_by_rows};

}  // namespace tendonfmu::estimation

#endif
