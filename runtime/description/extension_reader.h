/* The list `extensions` of a description: which effects, and where. */
#pragma once

#include <cstdint>
#include <vector>

#include "json_node.h"

namespace tendonfmu {

/* Appends a row of MODEL_EXTENSION_WORDS for each element to table: effect id, joint, tendon (from 1; 0 where there is
 * none), 0. Throws description_error. */
void read_extensions(const json_node& list, std::uint32_t joints, std::uint32_t tendons,
                     std::vector<std::uint32_t>& table);

}  // namespace tendonfmu
