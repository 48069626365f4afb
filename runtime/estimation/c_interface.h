/* What the two C interfaces of the estimation share: no exception passes them, and a refusal's line stays with the
 * handle. A handle is a struct with `mutable std::string error`. */
#pragma once

#include <cstdio>
#include <new>
#include <string>

#include "refusal.h"
#include "tendonfmu_estimation.h"
#include "unknowns.h"

namespace tendonfmu::estimation {

constexpr const char* missing = "an argument is missing: NULL";

/* Keeps the reason with the handle, if there is one; without memory for it there is none. */
template <typename Handle>
tendonfmu_status fail(const Handle* handle, tendonfmu_status status, const char* reason) noexcept {
  if (handle) {
    try {
      handle->error = reason;
    } catch (const std::bad_alloc&) {
      handle->error.clear();
    }
  }
  return status;
}

/* Runs what may throw. refusal: the status of what the body refuses, failure: of anything else. */
template <typename Handle, typename Body>
tendonfmu_status guarded(const Handle* handle, tendonfmu_status refusal, tendonfmu_status failure, const Body& body) {
  try {
    body();
    return TENDONFMU_OK;
  } catch (const refused& reason) {
    return fail(handle, refusal, reason.what());
  } catch (const std::bad_alloc&) {
    return fail(handle, failure, "out of memory");
  } catch (const std::exception& reason) {
    return fail(handle, failure, reason.what());
  }
}

template <typename Handle, typename Body>
tendonfmu_status guarded(const Handle* handle, tendonfmu_status failure, const Body& body) {
  return guarded(handle, failure, failure, body);
}

/* What make() gives, a new handle; nullptr and one line in message [message_size] where it throws or has no image. */
template <typename Make>
auto created(const void* image, char* message, std::size_t message_size, const Make& make) -> decltype(make()) {
  const auto say = [message, message_size](const char* line) {
    if (message && message_size) {
      std::snprintf(message, message_size, "%s", line);
    }
  };
  say("");
  if (!image) {
    say(missing);
    return nullptr;
  }
  try {
    return make();
  } catch (const std::bad_alloc&) {
    say("out of memory");
  } catch (const std::exception& reason) {
    say(reason.what());
  }
  return nullptr;
}

/* The unknown `index` of all, for a caller of C; its pointers stay valid as long as `all`. */
template <typename Handle>
tendonfmu_status describe_unknown(const Handle* handle, const unknown_list& all, std::size_t index,
                                  tendonfmu_unknown* unknown) {
  if (index >= all.count()) {
    return guarded(handle, TENDONFMU_BAD_ARGUMENT, [&] {
      throw refused("unknown " + std::to_string(index) + ": expected below " + std::to_string(all.count()));
    });
  }
  static const tendonfmu_role roles[] = {TENDONFMU_COULOMB, TENDONFMU_DROP, TENDONFMU_RATE, TENDONFMU_VISCOUS,
                                         TENDONFMU_VALUE};
  const unknown_item& u = all[index];
  *unknown = {roles[static_cast<int>(u.role)],
              u.start,
              u.lower,
              u.upper,
              u.scale,
              u.parameters.size(),
              u.parameters.data(),
              u.path.c_str()};
  return TENDONFMU_OK;
}

}  // namespace tendonfmu::estimation
