#include "symmetric_update.h"

namespace tendonfmu::estimation {
namespace {

struct Choice {
  SymmetricUpdate list[4] = {};

  Choice() {
    std::size_t count = 0;
#if defined(TENDONFMU_ESTIMATION_AVX2)
    __builtin_cpu_init();
    // these ask the operating system too: it must keep the registers
    if (__builtin_cpu_supports("avx512f")) {
      list[count++] = avx512_symmetric_update;
    }
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
      list[count++] = avx2_symmetric_update;
    }
#endif
    list[count] = portable_symmetric_update;
  }
};

}  // namespace

const SymmetricUpdate* symmetric_updates() {
  static const Choice choice;
  return choice.list;
}

const char* symmetric_update_name() {
  return symmetric_updates()->name;
}

void add_outer_products(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride,
                        double factor) {
  symmetric_updates()->add_outer_products(lower, p, rows, k, stride, factor);
}

void multiply_symmetric(double* product, std::size_t product_stride, const double* lower, std::size_t p,
                        const double* rows, std::size_t k, std::size_t stride) {
  symmetric_updates()->multiply_symmetric(product, product_stride, lower, p, rows, k, stride);
}

}  // namespace tendonfmu::estimation
