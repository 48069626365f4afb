// What the parts of the module _estimation share: numpy arrays in and out, and a watch in Python.
#pragma once

#include "arrays.h"
#include "tendonfmu_estimation.h"

using group_row = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// group and scale have a number for each of the description. It is counted by the finger alone: an estimator without
// them may refuse what they allow, such as a law of 0 whose scale is given.
inline void expect_all_numbers(const nb::bytes& image, const std::optional<group_row>& group,
                               const std::optional<number_row>& scale) {
  if (!group && !scale) {
    return;
  }
  const bound_handle<tendonfmu_finger, tendonfmu_destroy, tendonfmu_last_error> finger(
      [&](char* message, std::size_t size) { return tendonfmu_create(image.data(), image.size(), message, size); });
  const std::size_t count = tendonfmu_parameter_count(finger.get());
  const auto expect = [count](std::size_t length, const char* name) {
    if (length != count) {
      throw nb::value_error((std::string(name) + ": expected " + std::to_string(count) + " numbers").c_str());
    }
  };
  expect(group ? group->shape(0) : count, "group");
  expect(scale ? scale->shape(0) : count, "scale");
}

inline void expect_rows(const std::optional<number_rows>& rows, std::size_t samples, std::size_t columns,
                        const char* name) {
  if (rows && (rows->shape(0) != samples || rows->shape(1) != columns)) {
    throw nb::value_error((std::string(name) + ": expected " + std::to_string(samples) + " rows of " +
                           std::to_string(columns) + " columns")
                              .c_str());
  }
}

inline const double* data(const std::optional<number_rows>& rows) {
  return rows ? rows->data() : nullptr;
}

// What a recording's arrays have in common for estimator and learner.
struct sample_arrays {
  number_row time;
  number_rows tendon_force;
  std::optional<number_rows> tendon_position, joint_position, joint_velocity, external_torque;
  std::optional<flag_row> use;

  void check(std::size_t joints, std::size_t tendons) const {
    const std::size_t count = time.shape(0);
    expect_rows(tendon_force, count, tendons, "tendon_force");
    expect_rows(tendon_position, count, tendons, "tendon_position");
    expect_rows(joint_position, count, joints, "joint_position");
    expect_rows(joint_velocity, count, joints, "joint_velocity");
    expect_rows(external_torque, count, joints, "external_torque");
    if (use && use->shape(0) != count) {
      throw nb::value_error("use: expected one flag a sample");
    }
  }
  tendonfmu_inputs inputs() const {
    return {tendon_force.data(), data(tendon_position), data(joint_position), data(joint_velocity)};
  }
};

// An unknown: path, role, parameters, start, lower, upper, scale.
inline nb::tuple as_tuple(const tendonfmu_unknown& u) {
  return nb::make_tuple(std::string(u.path), static_cast<int>(u.role),
                        std::vector<std::uint32_t>(u.parameters, u.parameters + u.parameter_count), u.start, u.lower,
                        u.upper, u.scale);
}

// A Python callable that may stop a long call, also by Ctrl-C or by what it raises.
class python_watch {
 public:
  explicit python_watch(const nb::object& watch) : watch_(watch.is_none() ? nullptr : &watch) {}

  // Without the GIL; `arguments` are made with it. Returns 0 to stop.
  template <typename Arguments>
  int ask(const Arguments& arguments) {
    const nb::gil_scoped_acquire gil;
    try {
      if (PyErr_CheckSignals() != 0) { /* Ctrl-C */
        throw nb::python_error();
      }
      return !watch_ || !nb::object((*watch_)(*arguments())).is(nb::bool_(false));
    } catch (nb::python_error& error) {
      raised_ = std::make_unique<nb::python_error>(std::move(error));
      return 0;
    }
  }

  // Afterwards, with the GIL: what it raised.
  void rethrow() {
    if (raised_) {
      raised_->restore();
      throw nb::python_error();
    }
  }

 private:
  const nb::object* watch_;
  std::unique_ptr<nb::python_error> raised_;
};

// learner.cpp
void bind_learner(nb::module_& m);
