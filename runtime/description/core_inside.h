/* The core's own headers, which are C alone, from C++. */
#pragma once

/* what the core includes of the C library: its names never come to stand in extern "C" */
#include <cfloat>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>

extern "C" {
#include "bytes.h"
#include "contact_place.h"
#include "effect.h"
#include "extensions.h"
#include "finger_memory.h"
#include "friction_law.h"
#include "link_geometry.h"
#include "message.h"
#include "model_image.h"
#include "parameters.h"
#include "pseudo_inverse.h"
#include "sensor_fault.h"
}

namespace tendonfmu {

/* Calls visit(item) for all items of a model. No exception may pass through the core's C, so one is carried around it.
 */
template <typename Visit>
void visit_items(const model_shape& shape, const Visit& visit) {
  struct carrier {
    const Visit& visit;
    std::exception_ptr failure;
  } all{visit, nullptr};
  const auto call = [](void* context, const model_item* item) noexcept {
    carrier& all = *static_cast<carrier*>(context);
    try {
      all.visit(*item);
      return 0;
    } catch (...) {
      all.failure = std::current_exception();
      return -1;
    }
  };
  model_visit(&shape, call, &all);
  if (all.failure) {
    std::rethrow_exception(all.failure);
  }
}

}  // namespace tendonfmu
