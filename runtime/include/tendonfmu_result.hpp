/* Whether a call worked: the status of every call of tendonfmu.hpp, and what those return that make an object. */
#ifndef TENDONFMU_RESULT_HPP
#define TENDONFMU_RESULT_HPP

#include <utility>

#include "tendonfmu.h"

#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
#define TENDONFMU_HAS_EXCEPTIONS 1
#include <stdexcept>
#endif

namespace tendonfmu {

/* As in tendonfmu.h. */
enum class [[nodiscard]] status{ok = TENDONFMU_OK,
                                bad_argument = TENDONFMU_BAD_ARGUMENT,
                                bad_image = TENDONFMU_BAD_IMAGE,
                                bad_parameter = TENDONFMU_BAD_PARAMETER,
                                bad_sample = TENDONFMU_BAD_SAMPLE,
                                bad_state = TENDONFMU_BAD_STATE,
                                wrong_order = TENDONFMU_WRONG_ORDER};

#if defined(TENDONFMU_HAS_EXCEPTIONS)
class error : public std::runtime_error {
 public:
  error(status code, const char* message) : std::runtime_error(message), code_(code) {}
  status code() const noexcept { return code_; }

 private:
  status code_;
};
#endif

/* An object, or one line that says why there is none. */
template <typename T>
class [[nodiscard]] result {
 public:
  explicit operator bool() const noexcept { return code_ == status::ok; }
  status code() const noexcept { return code_; }
  const char* message() const noexcept { return message_; }

  /* The object; an empty one where there is none. */
  T& operator*() & noexcept { return object_; }
  T&& operator*() && noexcept { return std::move(object_); }
  T* operator->() noexcept { return &object_; }

#if defined(TENDONFMU_HAS_EXCEPTIONS)
  /* The object; throws an error where there is none. */
  T value() && {
    if (code_ != status::ok) {
      throw error(code_, message_);
    }
    return std::move(object_);
  }
#endif

 private:
  friend class image;
  friend class finger;

  T object_;
  status code_ = status::ok;
  char message_[400] = "";
};

}  // namespace tendonfmu

#endif
