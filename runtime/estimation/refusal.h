/* What the estimation refuses: one line, as everywhere. */
#ifndef TENDONFMU_ESTIMATION_REFUSAL_H
#define TENDONFMU_ESTIMATION_REFUSAL_H

#include <stdexcept>

namespace tendonfmu::estimation {

struct refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace tendonfmu::estimation

#endif
