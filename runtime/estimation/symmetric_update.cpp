#include "symmetric_update.h"

#include "processor.h"

namespace tendonfmu::estimation {
namespace {

struct update_choice {
  symmetric_update list[3] = {};

  update_choice() {
    std::size_t count = 0;
#if defined(TENDONFMU_ESTIMATION_AVX2)
    if (has_avx2_and_fma()) {
      list[count++] = avx2_symmetric_update;
    }
#endif
    list[count] = portable_symmetric_update;
  }
};

}  // namespace

const symmetric_update* symmetric_updates() {
  static const update_choice choice;
  return choice.list;
}

void add_outer_products(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride,
                        double factor) {
  symmetric_updates()->add_outer_products(lower, p, rows, k, stride, factor);
}

void multiply_symmetric(double* product, std::size_t product_stride, const double* lower, std::size_t p,
                        const double* rows, std::size_t k, std::size_t stride) {
  symmetric_updates()->multiply_symmetric(product, product_stride, lower, p, rows, k, stride);
}

void add_weighted_rows(double* target, std::size_t target_stride, std::size_t a, const double* weights,
                       std::size_t weight_stride, const double* rows, std::size_t k, std::size_t stride, std::size_t p,
                       double factor) {
  symmetric_updates()->add_weighted_rows(target, target_stride, a, weights, weight_stride, rows, k, stride, p, factor);
}

void multiply_transposed(double* product, std::size_t product_stride, const double* left, std::size_t a,
                         std::size_t left_stride, const double* right, std::size_t b, std::size_t right_stride,
                         std::size_t p) {
  symmetric_updates()->multiply_transposed(product, product_stride, left, a, left_stride, right, b, right_stride, p);
}

}  // namespace tendonfmu::estimation
