#include "products.h"

#include "processor.h"
#include "products_kernel.h"

namespace tendonfmu::estimation {

const products baseline_products = {"baseline", add_outer_products, multiply_symmetric, multiply_transposed,
                                    solve_lower};

const products& best_products() {
#if defined(TENDONFMU_ESTIMATION_AVX2)
  static const bool has_avx2 = has_avx2_and_fma();
  return has_avx2 ? avx2_products : baseline_products;
#else
  return baseline_products;
#endif
}

}  // namespace tendonfmu::estimation
