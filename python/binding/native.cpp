// The C interface as the Python module _native: numpy arrays in and out, one call for a whole recording.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tendonfmu_description.h"

namespace nb = nanobind;

namespace {

using number_rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using time_row = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

nb::bytes image_from_json(const nb::bytes& json) {
  void* image = nullptr;
  std::size_t size = 0;
  char message[600] = "";
  const tendonfmu_status status = tendonfmu_image_from_json(static_cast<const char*>(json.data()), json.size(), &image,
                                                            &size, message, sizeof message);
  if (status != TENDONFMU_OK) {
    throw nb::value_error(message);
  }
  nb::bytes result(image, size);
  tendonfmu_free_image(image);
  return result;
}

std::string image_guid(const nb::bytes& image, unsigned long long salt) {
  char guid[39];
  tendonfmu_image_guid(image.data(), image.size(), salt, guid);
  return guid;
}

// A numpy array that owns `values`.
template <typename Number>
nb::object as_array(std::vector<Number> values, std::vector<std::size_t> shape) {
  auto* kept = new std::vector<Number>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Number>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, Number>(kept->data(), shape.size(), shape.data(), owner));
}

struct output_rows {
  std::vector<double> numbers[6], detection[6], parts;
  std::vector<unsigned char> flags[3], observable;
  std::vector<double> tip_force, tip_std, misfit; /* these and what follows: of fingers with links */
  std::vector<int> contact_link;
  std::vector<double> change; /* these two: of fingers with contact.rest */
  std::vector<unsigned char> at_rest;
  std::vector<unsigned char> sensor_fault, contact_observable; /* of fingers with sensor_fault */

  output_rows(std::size_t samples, std::size_t n, std::size_t m, bool with_parts, bool with_place, bool with_rest,
              bool with_sensors) {
    for (auto& row : numbers) {
      row.resize(samples * n);
    }
    for (auto& row : detection) {
      row.resize(samples * n);
    }
    if (with_parts) {
      parts.resize(samples * n * (m + 3));
    }
    flags[0].resize(samples * n);
    flags[1].resize(samples);
    flags[2].resize(samples * m);
    if (with_place) {
      tip_force.resize(samples * 3);
      tip_std.resize(samples * 3);
      observable.resize(samples);
      misfit.resize(samples);
      contact_link.resize(samples);
    }
    if (with_rest) {
      change.resize(samples * n);
      at_rest.resize(samples);
    }
    if (with_sensors) {
      sensor_fault.resize(samples * m);
      contact_observable.resize(samples);
    }
  }
  template <typename Number>
  static Number* wanted(std::vector<Number>& rows) {
    return rows.empty() ? nullptr : rows.data();
  }
  tendonfmu_outputs view() {
    return {numbers[0].data(),
            numbers[1].data(),
            numbers[2].data(),
            numbers[3].data(),
            numbers[4].data(),
            numbers[5].data(),
            flags[0].data(),
            flags[1].data(),
            flags[2].data(),
            detection[0].data(),
            detection[1].data(),
            detection[2].data(),
            detection[3].data(),
            detection[4].data(),
            wanted(parts),
            wanted(tip_force),
            wanted(tip_std),
            wanted(observable),
            wanted(misfit),
            wanted(contact_link),
            wanted(change),
            wanted(at_rest),
            detection[5].data(),
            wanted(sensor_fault),
            wanted(contact_observable)};
  }
};

class bound_finger {
 public:
  explicit bound_finger(const nb::bytes& image) {
    char message[600] = "";
    handle_ = tendonfmu_create(image.data(), image.size(), message, sizeof message);
    if (handle_ == nullptr) {
      throw nb::value_error(message);
    }
  }
  ~bound_finger() { tendonfmu_destroy(handle_); }
  bound_finger(const bound_finger&) = delete;
  bound_finger& operator=(const bound_finger&) = delete;

  std::size_t joints() const { return tendonfmu_joint_count(handle_); }
  std::size_t tendons() const { return tendonfmu_tendon_count(handle_); }
  bool has_links() const { return tendonfmu_has_links(handle_) != 0; }
  bool watches_rest() const { return tendonfmu_watches_rest(handle_) != 0; }
  bool watches_sensors() const { return tendonfmu_watches_sensors(handle_) != 0; }
  std::size_t parameter_count() const { return tendonfmu_parameter_count(handle_); }
  std::string kernel() const { return tendonfmu_get_kernel(handle_); }
  void set_kernel(const std::string& name) { check(tendonfmu_set_kernel(handle_, name.c_str())); }
  int source() const { return tendonfmu_get_kinematics_source(handle_); }
  void set_source(int source) { check(tendonfmu_set_kinematics_source(handle_, source)); }
  void reset() { check(tendonfmu_reset(handle_)); }

  std::string parameter_path(std::size_t index) const {
    char path[80];
    check(tendonfmu_get_parameter_path(handle_, index, path, sizeof path));
    return path;
  }
  nb::tuple parameter_info(std::size_t index) const {
    tendonfmu_parameter_info i;
    check(tendonfmu_get_parameter_info(handle_, index, &i));
    return nb::make_tuple(i.start, i.minimum, i.maximum, i.above_minimum != 0, i.tunable != 0, i.unit);
  }
  std::size_t find_parameter(const std::string& path) const { return tendonfmu_find_parameter(handle_, path.c_str()); }
  std::vector<double> get_parameters(const std::vector<std::size_t>& indices) const {
    std::vector<double> values(indices.size());
    check(tendonfmu_get_parameters(handle_, indices.size(), indices.data(), values.data()));
    return values;
  }
  void set_parameters(const std::vector<std::size_t>& indices, const std::vector<double>& values) {
    if (indices.size() != values.size()) {
      throw nb::value_error("as many values as indices expected");
    }
    check(tendonfmu_set_parameters(handle_, indices.size(), indices.data(), values.data()));
  }

  nb::bytes save_state() const {
    std::vector<unsigned char> bytes(tendonfmu_state_size(handle_));
    check(tendonfmu_save_state(handle_, bytes.data(), bytes.size()));
    return nb::bytes(bytes.data(), bytes.size());
  }
  void restore_state(const nb::bytes& bytes) { check(tendonfmu_restore_state(handle_, bytes.data(), bytes.size())); }

  nb::tuple run(const time_row& time, const std::optional<number_rows>& force,
                const std::optional<number_rows>& position, const std::optional<number_rows>& angle,
                const std::optional<number_rows>& velocity, bool with_parts) {
    const std::size_t samples = time.shape(0), n = joints(), m = tendons();
    const tendonfmu_inputs inputs = {
        rows(force, samples, m, "tendon_force"), rows(position, samples, m, "tendon_position"),
        rows(angle, samples, n, "joint_position"), rows(velocity, samples, n, "joint_velocity")};
    output_rows outputs(samples, n, m, with_parts, has_links(), watches_rest(), watches_sensors());
    const tendonfmu_outputs view = outputs.view();
    std::size_t done = 0;
    tendonfmu_status status;
    {
      nb::gil_scoped_release released;
      status = tendonfmu_run(handle_, samples, time.data(), &inputs, &view, &done);
    }
    if (status != TENDONFMU_OK) {
      throw nb::value_error(("row " + std::to_string(done + 1) + ": " + tendonfmu_last_error(handle_)).c_str());
    }
    nb::list arrays;
    for (auto& row : outputs.numbers) {
      arrays.append(as_array(std::move(row), {samples, n}));
    }
    arrays.append(as_array(std::move(outputs.flags[0]), {samples, n}));
    arrays.append(as_array(std::move(outputs.flags[1]), {samples}));
    arrays.append(as_array(std::move(outputs.flags[2]), {samples, m}));
    for (auto& row : outputs.detection) {
      arrays.append(as_array(std::move(row), {samples, n}));
    }
    if (with_parts) {
      arrays.append(as_array(std::move(outputs.parts), {samples, n, m + 3}));
    }
    if (has_links()) {
      arrays.append(as_array(std::move(outputs.tip_force), {samples, std::size_t{3}}));
      arrays.append(as_array(std::move(outputs.tip_std), {samples, std::size_t{3}}));
      arrays.append(as_array(std::move(outputs.observable), {samples}));
      arrays.append(as_array(std::move(outputs.misfit), {samples}));
      arrays.append(as_array(std::move(outputs.contact_link), {samples}));
    }
    if (watches_rest()) {
      arrays.append(as_array(std::move(outputs.change), {samples, n}));
      arrays.append(as_array(std::move(outputs.at_rest), {samples}));
    }
    if (watches_sensors()) {
      arrays.append(as_array(std::move(outputs.sensor_fault), {samples, m}));
      arrays.append(as_array(std::move(outputs.contact_observable), {samples}));
    }
    return nb::tuple(arrays);
  }

  std::vector<std::vector<double>> directional_derivative(const std::vector<double>& force,
                                                          const std::vector<double>& position,
                                                          const std::vector<double>& angle,
                                                          const std::vector<double>& velocity) {
    const std::size_t n = joints(), m = tendons();
    if (force.size() != m || position.size() != m || angle.size() != n || velocity.size() != n) {
      throw nb::value_error("directional_derivative: expected m, m, n and n numbers");
    }
    std::vector<std::vector<double>> slopes(6, std::vector<double>(n));
    tendonfmu_outputs derivative = {};
    double** const rows[] = {&derivative.compensated_torque, &derivative.joint_torque, &derivative.friction_torque,
                             &derivative.bias_torque,        &derivative.joint_angle,  &derivative.joint_speed};
    for (std::size_t k = 0; k < 6; ++k) {
      *rows[k] = slopes[k].data();
    }
    const tendonfmu_inputs direction = {force.data(), position.data(), angle.data(), velocity.data()};
    check(tendonfmu_get_directional_derivative(handle_, &direction, &derivative));
    return slopes;
  }

 private:
  tendonfmu_finger* handle_ = nullptr;

  void check(tendonfmu_status status) const {
    if (status == TENDONFMU_OK) {
      return;
    }
    const std::string reason = tendonfmu_last_error(handle_);
    throw nb::value_error(reason.empty() ? "bad argument" : reason.c_str());
  }

  static const double* rows(const std::optional<number_rows>& array, std::size_t samples, std::size_t columns,
                            const char* name) {
    if (!array) {
      return nullptr;
    }
    if (array->shape(0) != samples || array->shape(1) != columns) {
      throw nb::value_error(
          (std::string(name) + ": expected " + std::to_string(samples) + " x " + std::to_string(columns) + " numbers")
              .c_str());
    }
    return array->data();
  }
};

}  // namespace

NB_MODULE(_native, m) {
  m.def("version", &tendonfmu_version);
  m.def("image_from_json", &image_from_json);
  m.def("image_guid", &image_guid);
  nb::class_<bound_finger>(m, "Finger")
      .def(nb::init<const nb::bytes&>())
      .def_prop_ro("joints", &bound_finger::joints)
      .def_prop_ro("tendons", &bound_finger::tendons)
      .def_prop_ro("has_links", &bound_finger::has_links)
      .def_prop_ro("watches_rest", &bound_finger::watches_rest)
      .def_prop_ro("watches_sensors", &bound_finger::watches_sensors)
      .def_prop_ro("parameter_count", &bound_finger::parameter_count)
      .def_prop_rw("kernel", &bound_finger::kernel, &bound_finger::set_kernel)
      .def_prop_rw("kinematics_source", &bound_finger::source, &bound_finger::set_source)
      .def("reset", &bound_finger::reset)
      .def("parameter_path", &bound_finger::parameter_path)
      .def("parameter_info", &bound_finger::parameter_info)
      .def("find_parameter", &bound_finger::find_parameter)
      .def("get_parameters", &bound_finger::get_parameters)
      .def("set_parameters", &bound_finger::set_parameters)
      .def("save_state", &bound_finger::save_state)
      .def("restore_state", &bound_finger::restore_state)
      .def("run", &bound_finger::run, nb::arg("time"), nb::arg("tendon_force").none(),
           nb::arg("tendon_position").none(), nb::arg("joint_position").none(), nb::arg("joint_velocity").none(),
           nb::arg("with_parts"))
      .def("directional_derivative", &bound_finger::directional_derivative);
}
