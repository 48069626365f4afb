// The C interface as the Python module _native: numpy arrays in and out, one call for a whole recording.
#include <cstring>

#include "arrays.h"
#include "output_table.h"
#include "tendonfmu_description.h"

namespace {

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

template <typename Value>
nb::object new_array_of(const std::vector<std::size_t>& shape, void** data) {
  auto [array, values] = new_array<Value>(shape);
  *data = values;
  return array;
}

nb::object new_output(output_type type, const std::vector<std::size_t>& shape, void** data) {
  switch (type) {
    case output_type::number: return new_array_of<double>(shape, data);
    case output_type::flag: return new_array_of<unsigned char>(shape, data);
    default: return new_array_of<int>(shape, data);
  }
}

// Sets the pointer of an output.
void set_array(tendonfmu_outputs& outputs, const output_row& row, void* data) {
  std::memcpy(reinterpret_cast<char*>(&outputs) + row.offset, &data, sizeof data);
}

class bound_finger : bound_handle<tendonfmu_finger, tendonfmu_destroy, tendonfmu_last_error> {
 public:
  explicit bound_finger(const nb::bytes& image)
      : bound_handle([&](char* message, std::size_t size) {
          return tendonfmu_create(image.data(), image.size(), message, size);
        }) {}

  std::size_t joints() const { return tendonfmu_joint_count(get()); }
  std::size_t tendons() const { return tendonfmu_tendon_count(get()); }
  bool has_links() const { return tendonfmu_has_links(get()) != 0; }
  bool watches_motors() const { return tendonfmu_watches_motors(get()) != 0; }
  bool watches_sensors() const { return tendonfmu_watches_sensors(get()) != 0; }
  std::size_t parameter_count() const { return tendonfmu_parameter_count(get()); }
  std::string kernel() const { return tendonfmu_get_kernel(get()); }
  void set_kernel(const std::string& name) { expect(tendonfmu_set_kernel(get(), name.c_str())); }
  int source() const { return tendonfmu_get_kinematics_source(get()); }
  void set_source(int source) { expect(tendonfmu_set_kinematics_source(get(), source)); }
  void reset() { expect(tendonfmu_reset(get())); }

  std::string parameter_path(std::size_t index) const {
    char path[80];
    expect(tendonfmu_get_parameter_path(get(), index, path, sizeof path));
    return path;
  }
  nb::tuple parameter_info(std::size_t index) const {
    tendonfmu_parameter_info i;
    expect(tendonfmu_get_parameter_info(get(), index, &i));
    return nb::make_tuple(i.start, i.minimum, i.maximum, i.above_minimum != 0, i.tunable != 0, i.unit);
  }
  std::size_t find_parameter(const std::string& path) const { return tendonfmu_find_parameter(get(), path.c_str()); }
  std::vector<double> get_parameters(const std::vector<std::size_t>& indices) const {
    std::vector<double> values(indices.size());
    expect(tendonfmu_get_parameters(get(), indices.size(), indices.data(), values.data()));
    return values;
  }
  void set_parameters(const std::vector<std::size_t>& indices, const std::vector<double>& values) {
    if (indices.size() != values.size()) {
      throw nb::value_error("as many values as indices expected");
    }
    expect(tendonfmu_set_parameters(get(), indices.size(), indices.data(), values.data()));
  }

  nb::bytes save_state() const {
    std::vector<unsigned char> bytes(tendonfmu_state_size(get()));
    expect(tendonfmu_save_state(get(), bytes.data(), bytes.size()));
    return nb::bytes(bytes.data(), bytes.size());
  }
  void restore_state(const nb::bytes& bytes) { expect(tendonfmu_restore_state(get(), bytes.data(), bytes.size())); }

  // Name of each output to its rows; with `learns` of tendonfmu_run_guided(), and residual_variance too.
  nb::dict run(const number_row& time, const std::optional<number_rows>& force,
               const std::optional<number_rows>& position, const std::optional<number_rows>& angle,
               const std::optional<number_rows>& velocity, bool with_terms, const std::optional<flag_row>& learns,
               const std::optional<number_rows>& known_torque) {
    const std::size_t samples = time.shape(0), n = joints(), m = tendons();
    const tendonfmu_inputs inputs = {
        rows(force, samples, m, "tendon_force"), rows(position, samples, m, "tendon_position"),
        rows(angle, samples, n, "joint_position"), rows(velocity, samples, n, "joint_velocity")};
    tendonfmu_outputs outputs = {};
    nb::dict arrays;
    for (const output_row& row : output_table) {
      if (row.need == output_need::terms ? with_terms : has(row.need)) {
        void* data = nullptr;
        arrays[row.name] = new_output(row.type, shape_of(row.size, samples), &data);
        set_array(outputs, row, data);
      }
    }
    tendonfmu_guide guide = {nullptr, rows(known_torque, samples, n, "known_torque"), nullptr};
    if (learns) {
      if (learns->shape(0) != samples) {
        throw nb::value_error(("learns: expected " + std::to_string(samples) + " flags").c_str());
      }
      void* variance = nullptr;
      arrays["residual_variance"] = new_output(output_type::number, {samples, n}, &variance);
      guide.learns = learns->data();
      guide.variance = static_cast<double*>(variance);
    }
    std::size_t done = 0;
    tendonfmu_status status;
    {
      nb::gil_scoped_release released;
      status = learns ? tendonfmu_run_guided(get(), samples, time.data(), &inputs, &guide, &outputs, &done)
                      : tendonfmu_run(get(), samples, time.data(), &inputs, &outputs, &done);
    }
    if (status != TENDONFMU_OK) {
      throw nb::value_error(("row " + std::to_string(done + 1) + ": " + tendonfmu_last_error(get())).c_str());
    }
    return arrays;
  }

  // Name of each output to the array that every step() writes: [n], [m], [3] or [1].
  nb::dict step_outputs() {
    if (!step_arrays_.is_valid()) {
      nb::dict arrays;
      for (const output_row& row : output_table) {
        if (row.need != output_need::terms && has(row.need)) {
          void* data = nullptr;
          const std::vector<std::size_t> shape = shape_of(row.size, 1);
          arrays[row.name] = new_output(row.type, {shape.back()}, &data);
          set_array(step_pointers_, row, data);
        }
      }
      step_arrays_ = arrays;
    }
    nb::dict shared;  // the arrays must live as long as the finger: the caller gets a dictionary of its own
    shared.update(step_arrays_);
    return shared;
  }

  // Takes one sample and writes the arrays of step_outputs(). A refused sample changes neither them nor the state.
  void step(double time, const std::optional<number_row>& force, const std::optional<number_row>& position,
            const std::optional<number_row>& angle, const std::optional<number_row>& velocity) {
    if (!step_arrays_.is_valid()) {
      step_outputs();
    }
    const std::size_t n = joints(), m = tendons();
    const tendonfmu_inputs inputs = {numbers(force, m, "tendon_force"), numbers(position, m, "tendon_position"),
                                     numbers(angle, n, "joint_position"), numbers(velocity, n, "joint_velocity")};
    expect(tendonfmu_run(get(), 1, &time, &inputs, &step_pointers_, nullptr));
  }

  // Name of each output that has a derivative to its n slopes.
  nb::dict directional_derivative(const std::vector<double>& force, const std::vector<double>& position,
                                  const std::vector<double>& angle, const std::vector<double>& velocity) {
    const std::size_t n = joints(), m = tendons();
    if (force.size() != m || position.size() != m || angle.size() != n || velocity.size() != n) {
      throw nb::value_error("directional_derivative: expected m, m, n and n numbers");
    }
    tendonfmu_outputs derivative = {};
    nb::dict slopes;
    for (const output_row& row : output_table) {
      if (row.has_derivative) {
        void* data = nullptr;
        slopes[row.name] = new_output(row.type, {n}, &data);
        set_array(derivative, row, data);
      }
    }
    const tendonfmu_inputs direction = {force.data(), position.data(), angle.data(), velocity.data()};
    expect(tendonfmu_get_directional_derivative(get(), &direction, &derivative));
    return slopes;
  }

 private:
  nb::dict step_arrays_ = nb::steal<nb::dict>(nb::handle());  // made by the first step_outputs()
  tendonfmu_outputs step_pointers_ = {};

  bool has(output_need need) const {
    switch (need) {
      case output_need::links: return has_links();
      case output_need::sensor_fault: return watches_sensors();
      default: return true;
    }
  }
  std::vector<std::size_t> shape_of(output_size size, std::size_t samples) const {
    switch (size) {
      case output_size::joints: return {samples, joints()};
      case output_size::tendons: return {samples, tendons()};
      case output_size::vector: return {samples, 3};
      case output_size::terms: return {samples, joints(), 4, 8};
      default: return {samples};
    }
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

  static const double* numbers(const std::optional<number_row>& array, std::size_t count, const char* name) {
    if (!array) {
      return nullptr;
    }
    if (array->shape(0) != count) {
      throw nb::value_error(
          (std::string(name) + ": " + std::to_string(array->shape(0)) + " numbers; expected " + std::to_string(count))
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
  m.def("memory_size", [](const nb::bytes& image) { return tendonfmu_memory_size(image.data(), image.size()); });
  nb::class_<bound_finger>(m, "Finger")
      .def(nb::init<const nb::bytes&>())
      .def_prop_ro("joints", &bound_finger::joints)
      .def_prop_ro("tendons", &bound_finger::tendons)
      .def_prop_ro("has_links", &bound_finger::has_links)
      .def_prop_ro("watches_motors", &bound_finger::watches_motors)
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
           nb::arg("with_terms"), nb::arg("learns").none(), nb::arg("known_torque").none())
      .def("step_outputs", &bound_finger::step_outputs)
      .def("step", &bound_finger::step, nb::arg("time"), nb::arg("tendon_force").none(),
           nb::arg("tendon_position").none(), nb::arg("joint_position").none(), nb::arg("joint_velocity").none())
      .def("directional_derivative", &bound_finger::directional_derivative);
}
