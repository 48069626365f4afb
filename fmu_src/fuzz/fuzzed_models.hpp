// Which model the FMUs of a fuzzer have: fuzzed_finger.cpp and fuzzed_plant.cpp say it.
#pragma once

#include <vector>

#include "promises.h"

namespace calls {

/* What FMUs are made of, each something else; the first is tried most. */
std::vector<promises::byte_list> resources();

/* s; longer ones that are no error would take minutes */
extern const double longest_step;

}  // namespace calls
