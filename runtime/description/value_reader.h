#pragma once

#include <vector>

#include "core_inside.h"
#include "json_node.h"

namespace tendonfmu {

/* Values of all parameters [parameter_count] in the core's order, each found in the document under the core's path for
 * it; defaults where it is absent. Not checked against the ranges. Throws description_error. */
std::vector<double> read_values(const json_node& document, const model_shape& shape);

}  // namespace tendonfmu
