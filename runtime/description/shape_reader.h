#pragma once

#include <cstdint>
#include <vector>

#include "core_inside.h"
#include "json_node.h"

namespace tendonfmu {

/* Which things a finger has; `shape` points into the two tables. */
struct finger_shape {
  model_shape shape{};
  std::vector<std::uint32_t> words, extensions;

  finger_shape() = default;
  finger_shape(finger_shape&&) = default; /* a moved vector keeps its block */
  finger_shape(const finger_shape&) = delete;
  finger_shape& operator=(const finger_shape&) = delete;
};

/* Walks the whole document: keys, lists and their lengths, names, flags. Numbers are left to read_values().
 * Throws description_error. */
finger_shape read_shape(const json_node& document);

}  // namespace tendonfmu
