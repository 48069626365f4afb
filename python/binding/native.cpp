// The C interface as the Python module _native: numpy arrays in and out, one call for a whole recording.
#include <cstring>
#include <string_view>
#include <unordered_map>

#include "arrays.h"
#include "output_table.h"
#include "tendonfmu_description.h"

namespace {

nb::bytes image_from_json(std::string_view json) {
  void* image = nullptr;
  std::size_t size = 0;
  char message[600] = "";
  const tendonfmu_status status =
      tendonfmu_image_from_json(json.data(), json.size(), &image, &size, message, sizeof message);
  if (status != TENDONFMU_OK) {
    throw refusal(message);
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

template <typename Value, typename Shown = Value>
nb::object new_array_of(const std::vector<std::size_t>& shape, void** data) {
  auto [array, values] = new_array<Value, Shown>(shape);
  *data = values;
  return array;
}

nb::object new_output(output_type type, const std::vector<std::size_t>& shape, void** data) {
  switch (type) {
    case output_type::number: return new_array_of<double>(shape, data);
    case output_type::flag: return new_array_of<unsigned char, bool>(shape, data);
    default: return new_array_of<int>(shape, data);
  }
}

// Sets the pointer of an output.
void set_array(tendonfmu_outputs& outputs, const output_row& row, void* data) {
  std::memcpy(reinterpret_cast<char*>(&outputs) + row.offset, &data, sizeof data);
}

class bound_finger : bound_handle<tendonfmu_finger, tendonfmu_destroy, tendonfmu_last_error> {
 public:
  bound_finger(const nb::bytes& image, int source)
      : bound_handle([&](char* message, std::size_t size) {
          return tendonfmu_create(image.data(), image.size(), message, size);
        }) {
    set_source(source);
  }

  std::size_t joints() const { return tendonfmu_joint_count(get()); }
  std::size_t tendons() const { return tendonfmu_tendon_count(get()); }
  bool has_links() const { return tendonfmu_has_links(get()) != 0; }
  bool watches_motors() const { return tendonfmu_watches_motors(get()) != 0; }
  bool watches_sensors() const { return tendonfmu_watches_sensors(get()) != 0; }
  std::size_t parameter_count() const { return tendonfmu_parameter_count(get()); }
  std::string kernel() const { return tendonfmu_get_kernel(get()); }
  void set_kernel(const std::string& name) { expect(tendonfmu_set_kernel(get(), name.c_str())); }
  void set_source(int source) { expect(tendonfmu_set_kinematics_source(get(), source)); }
  void reset() { expect(tendonfmu_reset(get())); }

  // path, start, minimum, maximum, above_minimum, tunable, unit; of each in canonical order
  nb::list parameter_rows() const {
    nb::list rows;
    for (std::size_t k = 0; k < parameter_count(); ++k) {
      char path[80];
      tendonfmu_parameter_info i;
      expect(tendonfmu_get_parameter_path(get(), k, path, sizeof path));
      expect(tendonfmu_get_parameter_info(get(), k, &i));
      rows.append(nb::make_tuple(path, i.start, i.minimum, i.maximum, i.above_minimum != 0, i.tunable != 0, i.unit));
    }
    return rows;
  }
  double get_parameter(const std::string& path) {
    const std::size_t index = index_of(path);
    double value = 0.0;
    expect(tendonfmu_get_parameters(get(), 1, &index, &value));
    return value;
  }
  void set_parameters(const nb::object& by_path) {
    std::vector<std::size_t> indices;
    std::vector<double> values;
    for (const nb::handle item : by_path.attr("items")()) {
      indices.push_back(index_of(nb::cast<std::string>(item[0])));
      values.push_back(nb::cast<double>(item[1]));
    }
    expect(tendonfmu_set_parameters(get(), indices.size(), indices.data(), values.data()));
  }
  nb::object values() const {
    std::vector<std::size_t> indices(parameter_count());
    std::iota(indices.begin(), indices.end(), std::size_t{0});
    std::vector<double> values(indices.size());
    expect(tendonfmu_get_parameters(get(), indices.size(), indices.data(), values.data()));
    return as_array(std::move(values));
  }

  nb::bytes save_state() const {
    std::vector<unsigned char> bytes(tendonfmu_state_size(get()));
    expect(tendonfmu_save_state(get(), bytes.data(), bytes.size()));
    return nb::bytes(bytes.data(), bytes.size());
  }
  void restore_state(const nb::bytes& bytes) { expect(tendonfmu_restore_state(get(), bytes.data(), bytes.size())); }

  // Name of each output to its rows; with `learns` of tendonfmu_run_guided(), and residual_variance too.
  nb::dict run(const nb::object& recording, bool with_terms, const std::optional<flag_row>& learns,
               const std::optional<number_rows>& known_torque) {
    const std::optional<number_row> time = array_in<number_row>(recording, "time");
    if (!time) {
      throw refusal("time: missing");
    }
    const auto force = array_in<number_rows>(recording, "tendon_force");
    const auto position = array_in<number_rows>(recording, "tendon_position");
    const auto angle = array_in<number_rows>(recording, "joint_position");
    const auto velocity = array_in<number_rows>(recording, "joint_velocity");
    const std::size_t samples = time->shape(0), n = joints(), m = tendons();
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
        throw refusal("learns: expected " + std::to_string(samples) + " flags");
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
      status = learns ? tendonfmu_run_guided(get(), samples, time->data(), &inputs, &guide, &outputs, &done)
                      : tendonfmu_run(get(), samples, time->data(), &inputs, &outputs, &done);
    }
    if (status != TENDONFMU_OK) {
      throw refusal("row " + std::to_string(done + 1) + ": " + tendonfmu_last_error(get()));
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
  nb::dict directional_derivative(const nb::object& direction) {
    const std::size_t n = joints(), m = tendons();
    const auto seed = [&](const char* name, std::size_t size) {
      const auto given = array_in<number_row>(direction, name);
      const double* first = numbers(given, size, name);
      return first ? std::vector<double>(first, first + size) : std::vector<double>(size, 0.0);
    };
    const std::vector<double> force = seed("tendon_force", m), position = seed("tendon_position", m),
                              angle = seed("joint_position", n), velocity = seed("joint_velocity", n);
    tendonfmu_outputs derivative = {};
    nb::dict slopes;
    for (const output_row& row : output_table) {
      if (row.has_derivative) {
        void* data = nullptr;
        slopes[row.name] = new_output(row.type, {n}, &data);
        set_array(derivative, row, data);
      }
    }
    const tendonfmu_inputs seeds = {force.data(), position.data(), angle.data(), velocity.data()};
    expect(tendonfmu_get_directional_derivative(get(), &seeds, &derivative));
    return slopes;
  }

 private:
  nb::dict step_arrays_ = nb::steal<nb::dict>(nb::handle());  // made by the first step_outputs()
  tendonfmu_outputs step_pointers_ = {};
  std::unordered_map<std::string, std::size_t> indices_;  // of parameters; the library looks through all paths

  std::size_t index_of(const std::string& path) {
    const auto [known, is_new] = indices_.try_emplace(path, 0);
    if (is_new) {
      known->second = tendonfmu_find_parameter(get(), path.c_str());
    }
    const std::size_t index = known->second;
    if (index >= parameter_count()) {
      indices_.erase(known);
      throw refusal("no parameter '" + path + "' in this finger");
    }
    return index;
  }
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
      throw refusal(
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
      throw refusal(
          (std::string(name) + ": " + std::to_string(array->shape(0)) + " numbers; expected " + std::to_string(count))
              .c_str());
    }
    return array->data();
  }
};

}  // namespace

NB_MODULE(_native, m) {
  nb::exception<refusal>(m, "NativeError", PyExc_ValueError);
  m.def("version", &tendonfmu_version);
  m.def("image_from_json", [](const nb::bytes& json) { return image_from_json({json.c_str(), json.size()}); });
  m.def("image_from_json", [](const std::string& json) { return image_from_json(json); });
  m.def("image_guid", &image_guid);
  m.def("memory_size", [](const nb::bytes& image) { return tendonfmu_memory_size(image.data(), image.size()); });
  nb::class_<bound_finger>(m, "Instance")
      .def(nb::init<const nb::bytes&, int>(), nb::arg("image"), nb::arg("kinematics_source") = 1)
      .def_prop_ro("joints", &bound_finger::joints)
      .def_prop_ro("tendons", &bound_finger::tendons)
      .def_prop_ro("has_links", &bound_finger::has_links)
      .def_prop_ro("watches_motors", &bound_finger::watches_motors)
      .def_prop_ro("watches_sensors", &bound_finger::watches_sensors)
      .def_prop_rw("kernel", &bound_finger::kernel, &bound_finger::set_kernel)
      .def("set_kinematics_source", &bound_finger::set_source)
      .def("reset", &bound_finger::reset)
      .def("parameter_rows", &bound_finger::parameter_rows)
      .def("get", &bound_finger::get_parameter)
      .def("set", &bound_finger::set_parameters)
      .def("values", &bound_finger::values)
      .def("save_state", &bound_finger::save_state)
      .def("restore_state", &bound_finger::restore_state)
      .def(
          "run",
          [](bound_finger& finger, const nb::object& recording, bool terms) {
            return finger.run(recording, terms, std::nullopt, std::nullopt);
          },
          nb::arg("recording"), nb::arg("terms") = false)
      .def(
          "run_guided",
          [](bound_finger& finger, const nb::object& recording, const flag_row& learns,
             const std::optional<number_rows>& known) { return finger.run(recording, false, learns, known); },
          nb::arg("recording"), nb::arg("learns"), nb::arg("known_torque").none())
      .def("step_outputs", &bound_finger::step_outputs)
      .def("step", &bound_finger::step, nb::arg("time"), nb::arg("tendon_force").none(),
           nb::arg("tendon_position") = nb::none(), nb::arg("joint_position") = nb::none(),
           nb::arg("joint_velocity") = nb::none())
      .def("directional_derivative", &bound_finger::directional_derivative);
}
