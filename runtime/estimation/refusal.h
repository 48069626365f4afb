/* What the estimation refuses: one line, as everywhere. */
#pragma once

#include <stdexcept>

namespace tendonfmu::estimation {

struct refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace tendonfmu::estimation
