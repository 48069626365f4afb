/* From the text of an expanded rig (docs/reference/rig.md) to its numbers. */
#pragma once

#include <cstddef>

#include "rig.h"

namespace tendonfmu::plant {

/* Throws description_error: key path, value, expectation, unit. */
rig read_rig(const char* text, std::size_t size);

}  // namespace tendonfmu::plant
