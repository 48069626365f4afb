/* The products on AVX2 with fused multiply-add. CMake gives this one file the flags; products.cpp sees to it that the
 * code is only entered where it can run. Of an inline function in two sources the linker keeps one copy: Eigen has
 * another name here, so that none of its functions compiled for this processor is taken elsewhere. */
#if defined(TENDONFMU_ESTIMATION_AVX2)

#define Eigen eigen_for_avx2
#include "products_kernel.h"

namespace tendonfmu::estimation {

const products avx2_products = {"avx2", add_outer_products, multiply_symmetric, multiply_transposed, solve_lower};

}  // namespace tendonfmu::estimation

#endif
