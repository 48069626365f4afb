// The simulated finger (tendonfmu_plant.h) as the Python module _plant: numpy arrays in and out, many samples in a
// call.
#include <array>
#include <cstdint>
#include <stdexcept>

#include "arrays.h"
#include "tendonfmu_plant.h"

namespace {

using namespace nb::literals;
using plant_signals = tendonfmu_plant_signals;

// What the integrator could not do; a refusal is what was asked of it.
struct solver_failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

enum class signal_size { one, three, six, joints, tendons };

struct number_signal {
  const char* name;
  double* plant_signals::*place;
  signal_size size;
};
constexpr number_signal numbers[] = {
    {"measured_tendon_force", &plant_signals::measured_tendon_force, signal_size::tendons},
    {"measured_tendon_position", &plant_signals::measured_tendon_position, signal_size::tendons},
    {"measured_joint_position", &plant_signals::measured_joint_position, signal_size::joints},
    {"measured_joint_velocity", &plant_signals::measured_joint_velocity, signal_size::joints},
    {"measured_external_torque", &plant_signals::measured_external_torque, signal_size::joints},
    {"tendon_force", &plant_signals::tendon_force, signal_size::tendons},
    {"tendon_position", &plant_signals::tendon_position, signal_size::tendons},
    {"joint_position", &plant_signals::joint_position, signal_size::joints},
    {"joint_velocity", &plant_signals::joint_velocity, signal_size::joints},
    {"joint_torque", &plant_signals::joint_torque, signal_size::joints},
    {"friction_torque", &plant_signals::friction_torque, signal_size::joints},
    {"external_torque", &plant_signals::external_torque, signal_size::joints},
    {"inertial_torque", &plant_signals::inertial_torque, signal_size::joints},
    {"stop_torque", &plant_signals::stop_torque, signal_size::joints},
    {"contact_force", &plant_signals::contact_force, signal_size::three},
    {"contact_point", &plant_signals::contact_point, signal_size::three},
    {"tip_position", &plant_signals::tip_position, signal_size::three},
    {"friction_level", &plant_signals::friction_level, signal_size::one},
    {"energy", &plant_signals::energy, signal_size::six},
};

struct flag_signal {
  const char* name;
  unsigned char* plant_signals::*place;
  signal_size size;
};
constexpr flag_signal flags[] = {
    {"contact", &plant_signals::contact, signal_size::one},
    {"slack", &plant_signals::slack, signal_size::tendons},
};

template <typename Entry, std::size_t count>
const Entry* find(const Entry (&entries)[count], const std::string& name) {
  for (const Entry& entry : entries) {
    if (name == entry.name) {
      return &entry;
    }
  }
  return nullptr;
}

class bound_plant : bound_handle<tendonfmu_plant, tendonfmu_plant_destroy, tendonfmu_plant_last_error> {
 public:
  explicit bound_plant(const std::string& json)
      : bound_handle([&](char* message, std::size_t size) {
          return tendonfmu_plant_create(json.data(), json.size(), message, size);
        }) {}

  std::size_t joints() const { return tendonfmu_plant_joint_count(get()); }
  std::size_t tendons() const { return tendonfmu_plant_tendon_count(get()); }
  std::size_t order() const { return tendonfmu_plant_order(get()); }
  double time() const { return tendonfmu_plant_get_time(get()); }
  bool initialised() const { return tendonfmu_plant_is_initialised(get()) != 0; }

  nb::object settings() const {
    const tendonfmu_plant_settings s = plain_settings();
    return namespace_of("relative_tolerance"_a = s.relative_tolerance, "scheduled_motion"_a = s.scheduled_motion != 0,
                        "scheduled_pushes"_a = s.scheduled_pushes != 0, "sensors"_a = s.sensors != 0, "seed"_a = s.seed,
                        "push_point"_a = nb::make_tuple(s.push_point[0], s.push_point[1], s.push_point[2]),
                        "push_link"_a = s.push_link);
  }
  void configure(std::optional<double> tolerance, std::optional<bool> motion, std::optional<bool> pushes,
                 std::optional<bool> sensors, std::optional<std::uint64_t> seed,
                 std::optional<std::array<double, 3>> point, std::optional<int> link) {
    tendonfmu_plant_settings s = plain_settings();
    s.relative_tolerance = tolerance.value_or(s.relative_tolerance);
    s.scheduled_motion = motion.value_or(s.scheduled_motion != 0);
    s.scheduled_pushes = pushes.value_or(s.scheduled_pushes != 0);
    s.sensors = sensors.value_or(s.sensors != 0);
    s.seed = seed.value_or(s.seed);
    s.push_link = link.value_or(s.push_link);
    if (point) {
      std::copy(point->begin(), point->end(), s.push_point);
    }
    check(tendonfmu_plant_set_settings(get(), &s));
  }
  void set_inputs(const std::optional<std::vector<double>>& command, double pretension,
                  const std::array<double, 3>& push) {
    if (command && command->size() != tendons()) {
      throw refusal("set_inputs: expected one command per tendon");
    }
    const tendonfmu_plant_inputs inputs = {
        command ? command->data() : nullptr, pretension, {push[0], push[1], push[2]}};
    check(tendonfmu_plant_set_inputs(get(), &inputs));
  }

  void initialise() {
    check(released([this] { return tendonfmu_plant_initialise(get()); }));
  }
  void advance(double time) {
    check(released([this, time] { return tendonfmu_plant_advance(get(), time); }));
  }
  void reset() { check(tendonfmu_plant_reset(get())); }
  nb::object hold_command() const {
    auto [command, values] = new_array<double>({tendons()});
    check(tendonfmu_plant_hold_command(get(), values));
    return command;
  }

  // The signals named, each an array of [samples, size], or [samples].
  nb::dict run(const number_row& time, const std::vector<std::string>& names) {
    const std::size_t samples = time.shape(0);
    plant_signals signals = {};
    nb::dict arrays;
    for (const std::string& name : names) {
      if (const number_signal* number = find(numbers, name)) {
        auto [array, values] = new_array<double>(shape_of(samples, number->size));
        signals.*(number->place) = values;
        arrays[name.c_str()] = array;
      } else if (const flag_signal* flag = find(flags, name)) {
        auto [array, values] = new_array<unsigned char, bool>(shape_of(samples, flag->size));
        signals.*(flag->place) = values;
        arrays[name.c_str()] = array;
      } else {
        throw refusal("no signal " + name);
      }
    }
    check(released([&] { return tendonfmu_plant_run(get(), samples, time.data(), &signals, nullptr); }));
    return arrays;
  }

  nb::bytes save_state() const {
    std::vector<unsigned char> bytes(tendonfmu_plant_state_size(get()));
    check(tendonfmu_plant_save_state(get(), bytes.data(), bytes.size()));
    return nb::bytes(bytes.data(), bytes.size());
  }
  void restore_state(const nb::bytes& bytes) {
    check(tendonfmu_plant_restore_state(get(), bytes.data(), bytes.size()));
  }
  nb::object statistics() const {
    tendonfmu_plant_statistics s;
    check(tendonfmu_plant_get_statistics(get(), &s));
    return namespace_of("steps"_a = s.steps, "right_hand_sides"_a = s.right_hand_sides, "jacobians"_a = s.jacobians,
                        "roots"_a = s.roots, "restarts"_a = s.restarts);
  }

  nb::object continuous_state() const {
    auto [array, values] = new_array<double>({order()});
    check(tendonfmu_plant_get_continuous_state(get(), values));
    return array;
  }
  nb::object derivative(double time, const number_row& state) const {
    const std::size_t size = order();
    if (state.shape(0) != size) {
      throw refusal("derivative: expected a state of " + std::to_string(size) + " numbers");
    }
    auto [slope, values] = new_array<double>({size});
    check(tendonfmu_plant_derivative(get(), time, state.data(), values));
    return slope;
  }

 private:
  // Other Python threads go on while the plant integrates.
  template <typename Call>
  static tendonfmu_plant_status released(const Call& call) {
    nb::gil_scoped_release release;
    return call();
  }

  template <typename... Fields>
  static nb::object namespace_of(Fields&&... fields) {
    return nb::module_::import_("types").attr("SimpleNamespace")(std::forward<Fields>(fields)...);
  }

  tendonfmu_plant_settings plain_settings() const {
    tendonfmu_plant_settings s;
    check(tendonfmu_plant_get_settings(get(), &s));
    return s;
  }

  void check(tendonfmu_plant_status status) const {
    if (status == TENDONFMU_PLANT_SOLVER) {
      throw solver_failure(reason());
    }
    expect(status);
  }

  std::vector<std::size_t> shape_of(std::size_t samples, signal_size size) const {
    switch (size) {
      case signal_size::three: return {samples, 3};
      case signal_size::six: return {samples, 6};
      case signal_size::joints: return {samples, joints()};
      case signal_size::tendons: return {samples, tendons()};
      default: return {samples};
    }
  }
};

}  // namespace

NB_MODULE(_plant, m) {
  const nb::exception<refusal> refused(m, "PlantError", PyExc_ValueError);
  nb::exception<solver_failure>(m, "SolverError", refused.ptr());
  std::vector<std::string> all;
  for (const number_signal& number : numbers) {
    all.emplace_back(number.name);
  }
  for (const flag_signal& flag : flags) {
    all.emplace_back(flag.name);
  }
  const nb::object none = nb::none();
  nb::class_<bound_plant>(m, "Plant")
      .def(nb::init<const std::string&>())
      .def_prop_ro("joints", &bound_plant::joints)
      .def_prop_ro("tendons", &bound_plant::tendons)
      .def_prop_ro("order", &bound_plant::order)
      .def_prop_ro("time", &bound_plant::time)
      .def_prop_ro("initialised", &bound_plant::initialised)
      .def_prop_ro("settings", &bound_plant::settings)
      .def("configure", &bound_plant::configure, "relative_tolerance"_a = none, "scheduled_motion"_a = none,
           "scheduled_pushes"_a = none, "sensors"_a = none, "seed"_a = none, "push_point"_a = none,
           "push_link"_a = none)
      .def("set_inputs", &bound_plant::set_inputs, "tendon_position_command"_a = none, "pretension"_a = 0.0,
           "push_force"_a = std::array<double, 3>{})
      .def("initialise", &bound_plant::initialise)
      .def("advance", &bound_plant::advance)
      .def("reset", &bound_plant::reset)
      .def("hold_command", &bound_plant::hold_command)
      .def("run", &bound_plant::run, "time"_a, "signals"_a = all)
      .def("save_state", &bound_plant::save_state)
      .def("restore_state", &bound_plant::restore_state)
      .def_prop_ro("statistics", &bound_plant::statistics)
      .def("continuous_state", &bound_plant::continuous_state)
      .def("derivative", &bound_plant::derivative);
}
