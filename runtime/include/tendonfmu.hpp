/* TendonFMU in C++17 (and later): a finger that frees itself, over the C interface of tendonfmu.h. Header only.
 *
 *   auto finger = tendonfmu::finger::from_json(text).value();       throws tendonfmu::error; or ask the result
 *   finger.initialise(t0, {force, position})                        takes the first sample
 *   finger.step(t, {force, position})                               takes the sample at t
 *   finger.get_outputs(outputs)                                     belong to the sample last taken
 *
 * Units, threads, real time and the meaning of every call are those of tendonfmu.h. What differs:
 *   Ownership  A finger can be moved, not copied. One that was moved from is empty: its sizes are 0, and its calls
 *              return status::bad_argument.
 *   Sizes      Arrays come as spans. A call with a span of another size than the finger needs is refused; an empty span
 *              is an array that is not there.
 *   Errors     What makes an object returns a result, which holds it or the reason why not, and has value() for those
 *              who want an exception. All other calls are noexcept and return a status; last_error() is the reason.
 *              Nothing in a loop throws or allocates. With -fno-exceptions, value() and the throwing constructor are
 *              not there. */
#ifndef TENDONFMU_HPP
#define TENDONFMU_HPP

#include <cstdio>
#include <string_view>
#include <utility>

#include "tendonfmu.h"
#include "tendonfmu_description.h"
#include "tendonfmu_outputs.hpp"
#include "tendonfmu_result.hpp"
#include "tendonfmu_span.hpp"

namespace tendonfmu {

enum class kinematics_source {
  tendon_positions = TENDONFMU_TENDON_POSITIONS,
  joint_positions = TENDONFMU_JOINT_POSITIONS,
  joint_velocities = TENDONFMU_JOINT_VELOCITIES
};

/* Inputs of one sample, or of many (finger::run): row-major [samples × m] or [samples × n]. Which are needed: see
 * tendonfmu_inputs. */
struct inputs {
  span<const double> tendon_force = {};    /* [m] N */
  span<const double> tendon_position = {}; /* [m] m */
  span<const double> joint_position = {};  /* [n] rad */
  span<const double> joint_velocity = {};  /* [n] rad/s */
};

/* A model image, made of a description. Needs the library tendonfmu::description; an image that is a file or a constant
 * array needs no such object. */
class image {
 public:
  image() noexcept = default;
  image(image&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  image& operator=(image&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~image() { tendonfmu_free_image(bytes_.data()); }

  /* Text of a finger description, format "tendonfmu-finger-1". */
  static result<image> from_json(std::string_view text) noexcept {
    result<image> made;
    void* block = nullptr;
    std::size_t size = 0;
    made.code_ = static_cast<status>(
        tendonfmu_image_from_json(text.data(), text.size(), &block, &size, made.message_, sizeof made.message_));
    made.object_.bytes_ = {static_cast<unsigned char*>(block), size};
    return made;
  }

  const unsigned char* data() const noexcept { return bytes_.data(); }
  std::size_t size() const noexcept { return bytes_.size(); }

 private:
  span<unsigned char> bytes_;
};

class finger {
 public:
  /* An empty finger, to be assigned to. */
  finger() noexcept = default;

  /* A finger in memory of its own, from one malloc(). The image may go afterwards. */
  static result<finger> create(span<const unsigned char> image) noexcept {
    result<finger> made;
    made.object_.take(tendonfmu_create(image.data(), image.size(), made.message_, sizeof made.message_), true);
    return judged(std::move(made));
  }

  /* A finger in `memory`, which must stay where it is for as long as the finger lives; nothing is allocated. */
  static result<finger> place(span<unsigned char> memory, span<const unsigned char> image) noexcept {
    result<finger> made;
    made.object_.take(
        tendonfmu_place(memory.data(), memory.size(), image.data(), image.size(), made.message_, sizeof made.message_),
        false);
    return judged(std::move(made));
  }

  /* Bytes for place(); 0 where the image is refused. */
  static std::size_t memory_size(span<const unsigned char> image) noexcept {
    return tendonfmu_memory_size(image.data(), image.size());
  }

  /* From the text of a description, by way of an image. Needs the library tendonfmu::description. */
  static result<finger> from_json(std::string_view text) noexcept {
    result<image> read = image::from_json(text);
    if (read) {
      return create(*read);
    }
    result<finger> made;
    made.code_ = read.code();
    std::snprintf(made.message_, sizeof made.message_, "%s", read.message());
    return made;
  }

  finger(finger&& other) noexcept { swap(other); }
  finger& operator=(finger&& other) noexcept {
    finger taken(std::move(other));
    swap(taken);
    return *this;
  }
  ~finger() {
    if (owns_) {
      tendonfmu_destroy(handle_);
    }
  }

  /* False for an empty finger. */
  explicit operator bool() const noexcept { return handle_ != nullptr; }
  std::size_t joint_count() const noexcept { return joints_; }
  std::size_t tendon_count() const noexcept { return tendons_; }
  bool has_links() const noexcept { return tendonfmu_has_links(handle_) != 0; }
  bool watches_motors() const noexcept { return tendonfmu_watches_motors(handle_) != 0; }
  bool watches_sensors() const noexcept { return tendonfmu_watches_sensors(handle_) != 0; }

  /* One line about the last call that failed. Valid until the next call. */
  const char* last_error() const noexcept { return size_error_[0] ? size_error_ : tendonfmu_last_error(handle_); }

  /* For calls of tendonfmu.h beyond these; it stays the finger's. nullptr of an empty one. */
  tendonfmu_finger* handle() const noexcept { return handle_; }

  /* --- Samples --- */

  status set_kinematics_source(kinematics_source source) noexcept {
    return to_status(tendonfmu_set_kinematics_source(handle_, static_cast<int>(source)));
  }
  kinematics_source get_kinematics_source() const noexcept {
    return static_cast<kinematics_source>(tendonfmu_get_kinematics_source(handle_));
  }

  status initialise(double time, const inputs& sample) noexcept {
    tendonfmu_inputs arrays;
    return unpack(sample, 1, arrays) ? to_status(tendonfmu_initialise(handle_, time, &arrays)) : status::bad_argument;
  }
  status step(double time, const inputs& sample) noexcept {
    tendonfmu_inputs arrays;
    return unpack(sample, 1, arrays) ? to_status(tendonfmu_step(handle_, time, &arrays)) : status::bad_argument;
  }
  status get_outputs(const outputs& wanted) const noexcept {
    tendonfmu_outputs arrays;
    return unpack(wanted, 1, arrays) ? to_status(tendonfmu_get_outputs(handle_, &arrays)) : status::bad_argument;
  }

  /* time.size() samples in one call; `done` receives how many were taken. */
  status run(span<const double> time, const inputs& samples, const outputs& wanted, std::size_t& done) noexcept {
    tendonfmu_inputs from;
    tendonfmu_outputs to;
    done = 0;
    if (!unpack(samples, time.size(), from) || !unpack(wanted, time.size(), to)) {
      return status::bad_argument;
    }
    return to_status(tendonfmu_run(handle_, time.size(), time.data(), &from, &to, &done));
  }

  status get_directional_derivative(const inputs& direction, const outputs& derivative) noexcept {
    tendonfmu_inputs from;
    tendonfmu_outputs to;
    return unpack(direction, 1, from) && unpack(derivative, 1, to)
               ? to_status(tendonfmu_get_directional_derivative(handle_, &from, &to))
               : status::bad_argument;
  }

  double get_time() const noexcept { return tendonfmu_get_time(handle_); }
  bool is_initialised() const noexcept { return tendonfmu_is_initialised(handle_) != 0; }

  /* --- Parameters: between any two steps; a path, or an index found once for all --- */

  status get_parameter(const char* path, double& value) const noexcept {
    return to_status(tendonfmu_get_parameter(handle_, path, &value));
  }
  status set_parameter(const char* path, double value) noexcept {
    return to_status(tendonfmu_set_parameter(handle_, path, value));
  }
  std::size_t parameter_count() const noexcept { return tendonfmu_parameter_count(handle_); }

  /* parameter_count() when there is none. */
  std::size_t find_parameter(const char* path) const noexcept { return tendonfmu_find_parameter(handle_, path); }

  /* Writes the path and a zero; 80 bytes are enough. */
  status get_parameter_path(std::size_t index, span<char> path) const noexcept {
    return to_status(tendonfmu_get_parameter_path(handle_, index, path.data(), path.size()));
  }
  status get_parameter_info(std::size_t index, tendonfmu_parameter_info& info) const noexcept {
    return to_status(tendonfmu_get_parameter_info(handle_, index, &info));
  }

  /* As many indices as values, or none: then the parameters from 0 on. */
  status get_parameters(span<const std::size_t> indices, span<double> values) const noexcept {
    return match_indices(indices, values.size())
               ? to_status(tendonfmu_get_parameters(handle_, values.size(), pointer(indices), values.data()))
               : status::bad_argument;
  }
  status set_parameters(span<const std::size_t> indices, span<const double> values) noexcept {
    return match_indices(indices, values.size())
               ? to_status(tendonfmu_set_parameters(handle_, values.size(), pointer(indices), values.data()))
               : status::bad_argument;
  }

  /* All parameters of another finger of the same image: bounded time, for a loop that another thread prepares them for.
   */
  status take_parameters(const finger& prepared) noexcept {
    return to_status(tendonfmu_take_parameters(handle_, prepared.handle_));
  }

  /* --- State: of state_size() bytes; to be restored into this finger or another one of the same image --- */

  std::size_t state_size() const noexcept { return tendonfmu_state_size(handle_); }
  status save_state(span<unsigned char> bytes) const noexcept {
    return to_status(tendonfmu_save_state(handle_, bytes.data(), bytes.size()));
  }
  status restore_state(span<const unsigned char> bytes) noexcept {
    return to_status(tendonfmu_restore_state(handle_, bytes.data(), bytes.size()));
  }
  status reset() noexcept { return to_status(tendonfmu_reset(handle_)); }

  /* --- Kernels --- */

  const char* get_kernel() const noexcept { return tendonfmu_get_kernel(handle_); }
  status set_kernel(const char* name) noexcept { return to_status(tendonfmu_set_kernel(handle_, name)); }

#if defined(TENDONFMU_HAS_EXCEPTIONS)
  /* As create(); throws an error where the image is refused. */
  explicit finger(span<const unsigned char> image) : finger(create(image).value()) {}
#endif

 private:
  void take(tendonfmu_finger* handle, bool owns) noexcept {
    handle_ = handle;
    owns_ = owns;
    joints_ = tendonfmu_joint_count(handle);
    tendons_ = tendonfmu_tendon_count(handle);
  }

  static result<finger> judged(result<finger> made) noexcept {
    made.code_ = made.object_ ? status::ok : status::bad_image;
    return made;
  }

  void swap(finger& other) noexcept {
    std::swap(handle_, other.handle_);
    std::swap(owns_, other.owns_);
    std::swap(joints_, other.joints_);
    std::swap(tendons_, other.tendons_);
    std::swap(size_error_, other.size_error_);
  }

  // What C has to say takes the place of an earlier error of size.
  status to_status(tendonfmu_status code) const noexcept {
    if (code != TENDONFMU_OK) {
      size_error_[0] = 0;
    }
    return static_cast<status>(code);
  }

  template <typename T>
  static T* pointer(span<T> array) noexcept {
    return array.empty() ? nullptr : array.data();
  }

  bool has_size(const char* name, std::size_t given, std::size_t expected) const noexcept {
    if (given == 0 || given == expected || !handle_) {
      return true;
    }
    std::snprintf(size_error_, sizeof size_error_, "%s: %zu values, expected %zu", name, given, expected);
    return false;
  }

  bool match_indices(span<const std::size_t> indices, std::size_t count) const noexcept {
    return has_size("indices", indices.size(), count);
  }

  bool unpack(const inputs& given, std::size_t samples, tendonfmu_inputs& c) const noexcept {
    c = {pointer(given.tendon_force), pointer(given.tendon_position), pointer(given.joint_position),
         pointer(given.joint_velocity)};
    return has_size("tendon_force", given.tendon_force.size(), samples * tendons_) &&
           has_size("tendon_position", given.tendon_position.size(), samples * tendons_) &&
           has_size("joint_position", given.joint_position.size(), samples * joints_) &&
           has_size("joint_velocity", given.joint_velocity.size(), samples * joints_);
  }

  // Without a branch for each output: 25 of them took 9 % of a step.
  bool unpack(const outputs& wanted, std::size_t samples, tendonfmu_outputs& c) const noexcept {
    int wrong = 0;
    c.size = sizeof c;
    detail::for_each_output(wanted, c, joints_, tendons_,
                            [&](const char*, auto array, auto*& to, std::size_t count) noexcept {
                              to = pointer(array);
                              const int is_wanted = array.size() != 0;
                              const int differs = array.size() != samples * count;
                              wrong |= is_wanted & differs;
                            });
    return wrong == 0 || have_sizes(wanted, samples);
  }

  // The same, to name the first one that is wrong.
  bool have_sizes(const outputs& wanted, std::size_t samples) const noexcept {
    bool all = true;
    tendonfmu_outputs unused;
    detail::for_each_output(wanted, unused, joints_, tendons_,
                            [&](const char* name, auto array, auto*&, std::size_t count) noexcept {
                              all = all && has_size(name, array.size(), samples * count);
                            });
    return all;
  }

  tendonfmu_finger* handle_ = nullptr;
  bool owns_ = false;
  std::size_t joints_ = 0, tendons_ = 0;
  mutable char size_error_[96] = "";
};

}  // namespace tendonfmu

#endif
