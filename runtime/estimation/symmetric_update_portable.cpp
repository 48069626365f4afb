/* The products on what every processor of an architecture has: two numbers at once. */
#include "symmetric_update_kernel.h"

namespace tendonfmu::estimation {

const symmetric_update portable_symmetric_update = {"portable", add_products, multiply_rows, mix_rows,
                                                    multiply_by_rows};

}  // namespace tendonfmu::estimation
