// A finger and a motion for the tests of the runtime: two joints, three tendons, every kind of term, 1 kHz.
#pragma once

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tendonfmu_description.h"
#include "tendonfmu_outputs.hpp"

namespace test_finger {

inline const char* const json = R"({
  "format": "tendonfmu-finger-1", "name": "test",
  "joints": [
    {"name": "base", "cover": {"stiffness": 0.05, "rest_angle": 0.1},
     "friction": {"static": 0.004, "coulomb": 0.003, "stribeck_velocity": 0.1, "viscous": 0.001},
     "load_friction": {"static": 1e-4, "coulomb": 8e-5, "stribeck_velocity": 0.1}},
    {"name": "tip", "friction": {"positive": {"static": 0.003, "coulomb": 0.002, "stribeck_velocity": 0.1},
                                 "negative": {"static": 0.004, "coulomb": 0.002, "stribeck_velocity": 0.2}}}],
  "tendons": [
    {"stiffness": 4000, "moment_arms": [0.008, 0.006],
     "pulley_friction": [{"static": 0.02, "coulomb": 0.015, "stribeck_velocity": 0.004, "viscous": 0.1}],
     "edge_friction": [null, {"angles": [-0.5, 0.1, 0.6], "laws": [
        {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.3},
        {"static": 0.02, "coulomb": 0.02, "stribeck_velocity": 0.004, "viscous": 0.2},
        {"static": 0.05, "coulomb": 0.03, "stribeck_velocity": 0.006, "viscous": 0.1}]}]},
    {"stiffness": 3000, "moment_arms": [-0.008, -0.006],
     "edge_friction": [{"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005}]},
    {"stiffness": 5000, "moment_arms": [-0.007, 0.005], "bidirectional": true,
     "pulley_friction": [{"static": 0.02, "coulomb": 0.01, "stribeck_velocity": 0.004}]}],
  "velocity_threshold": {"tendon": 0.0005, "joint": 0.02},
  "bias": {"noise_std_per_force": 1e-4},
  "contact": {"threshold": [0.04, 0.04], "threshold_per_force": [1e-4, 1e-4]},
  "extensions": [{"effect": "cover_hardening", "joint": 1, "stiffness": 0.01}]})";

inline const std::string name = "\"name\": \"test\",";

inline void put(std::string& text, const std::string& after, const std::string& added) {
  text.insert(text.find(after) + after.size(), added);
}

// The same with every optional key of the detection. Two joints in contact by turns.
inline std::string every_key() {
  std::string text = json;
  const std::string band = R"({"noise": [0.03, 0.02], "friction": [0.05, 0.02], "friction_limit": [0.1, 0.1],
    "motor_load": [1e-3, 2e-3], "friction_change": [0.1, 0.2], "friction_reserve": [0.1, 0.3]})";
  put(text, "\"bias\": {", R"("forgetting": "absorption", )");
  put(text, "\"contact\": {",
      R"("method": "bands", "watches_motors": true, "bands": [)" + band + ", " + band + ", " + band + ", " + band +
          R"(],
    "deviation": [0.002, 0.003], "deviation_per_force": [1e-5, 2e-5], )");
  put(text, name, R"("links": [{"axis": [0, 0, 2]}, {"axis": [0, 1, 0.2], "offset": [0.05, 0, 0]}],
    "tip": [0.03, 0, 0.004],)");
  return text;
}

// The same, with sensors that are watched.
inline std::string watched_sensors() {
  std::string text = every_key();
  put(text, name,
      R"("sensor_fault": {"jump_margin": 0.5, "spring_margin": 0.5, "longest_stand": 0.2, "recovery_time": 0.05},)");
  return text;
}

// And with a position filter and every effect of `extensions`, at every kind of place.
inline std::string every_effect() {
  std::string text = every_key();
  put(text, "\"extensions\": [", R"({"effect": "gravity", "joint": 2, "sine": 0.02, "cosine": -0.03},
    {"effect": "inertia", "joint": 1, "inertia": 1e-4}, {"effect": "joint_coupling", "joint": 1, "stiffness": 0.05},
    {"effect": "preload_friction", "tendon": 1, "coulomb": 0.4},
    {"effect": "preload_friction", "joint": 2, "tendon": 2, "coulomb": 0.4},
    {"effect": "load_friction", "joint": 2, "tendon": 1, "coulomb": 2e-4},
    {"effect": "force_gain", "tendon": 2, "correction": 0.07},
    {"effect": "force_offset", "tendon": 1, "correction": -0.5},
    {"effect": "moment_arm", "joint": 1, "tendon": 3, "correction": 6e-4},
    {"effect": "moment_arm_variation", "joint": 2, "tendon": 2, "slope": -4e-4},
    {"effect": "pulley_eccentricity", "joint": 1, "tendon": 1, "sine": 5e-4, "cosine": 3e-4},
    {"effect": "presliding", "joint": 1, "displacement": 0.02},
    {"effect": "presliding", "tendon": 3, "displacement": 2e-4},
    {"effect": "friction_drift", "amplitude": 0.3, "time_constant": 0.5},
    {"effect": "friction_drift", "joint": 2, "amplitude": -0.2, "time_constant": 5},
    {"effect": "friction_drift", "tendon": 2, "amplitude": 0.2, "time_constant": 5},
    {"effect": "stribeck", "joint": 1, "amplitude": -0.4, "stribeck_velocity": 0.3},
    {"effect": "stribeck", "tendon": 1, "amplitude": 0.4, "stribeck_velocity": 0.004},
    {"effect": "tendon_nonlinearity", "tendon": 2, "hardening": 1e5},
    {"effect": "backlash", "joint": 2, "width": 0.02}, {"effect": "backlash", "tendon": 1, "width": 2e-4},
    {"effect": "time_delay", "delay": 0.0033}, )");
  return text;
}

constexpr std::size_t joints = 2, tendons = 3;

inline std::vector<unsigned char> image(const std::string& text = json) {
  void* block = nullptr;
  std::size_t size = 0;
  char message[400] = "";
  if (tendonfmu_image_from_json(text.data(), text.size(), &block, &size, message, sizeof message) != TENDONFMU_OK) {
    std::fprintf(stderr, "test finger refused: %s\n", message);
    std::abort();
  }
  const auto* bytes = static_cast<const unsigned char*>(block);
  std::vector<unsigned char> copy(bytes, bytes + size);
  tendonfmu_free_image(block);
  return copy;
}

// The fingers that every promise of tendonfmu.h is tried on: the paper's, with every key beyond it, with watched
// sensors, with every effect.
enum Kind { paper, detecting, watching, extended, kinds };

inline const std::vector<unsigned char>& image_of(int kind) {
  static const std::vector<unsigned char> images[kinds] = {image(), image(every_key()), image(watched_sensors()),
                                                           image(every_effect())};
  return images[kind];
}

// Inputs of a motion with reversals, rests and two pushes; row-major as tendonfmu_run() takes them.
struct Motion {
  std::vector<double> time, force, position, angle, velocity;

  explicit Motion(std::size_t samples) {
    const double arm[tendons][joints] = {{0.008, 0.006}, {-0.008, -0.006}, {-0.007, 0.005}};
    const double stiffness[tendons] = {4000, 3000, 5000};
    double phase = 0.0;
    for (std::size_t k = 0; k < samples; ++k) {
      const double t = 1e-3 * static_cast<double>(k);
      const bool rests = std::fmod(t, 1.5) > 1.1;
      phase += rests ? 0.0 : 4e-3;
      const double q[joints] = {0.6 * std::sin(phase), 0.5 * std::sin(1.7 * phase) + 0.1};
      const double v[joints] = {rests ? 0.0 : 2.4 * std::cos(phase), rests ? 0.0 : 3.4 * std::cos(1.7 * phase)};
      const bool pushed = std::fmod(t, 2.0) > 1.8;
      time.push_back(t);
      for (std::size_t i = 0; i < tendons; ++i) {
        const double f = 15.0 + 2.0 * static_cast<double>(i) + std::sin(3.0 * t + static_cast<double>(i)) -
                         (i == 2 ? 19.0 : 0.0) + (pushed && i == 0 ? 9.0 : 0.0);
        force.push_back(f);
        position.push_back(arm[i][0] * q[0] + arm[i][1] * q[1] + f / stiffness[i]);
      }
      angle.insert(angle.end(), q, q + joints);
      velocity.insert(velocity.end(), v, v + joints);
    }
  }

  // The force of a tendon reads 0 for 0.3 s of every 2 s.
  void let_force_fail(std::size_t tendon) {
    for (std::size_t k = 0; k < time.size(); ++k) {
      if (std::fmod(time[k], 2.0) > 1.0 && std::fmod(time[k], 2.0) < 1.3) {
        force[k * tendons + tendon] = 0.0;
      }
    }
  }

  tendonfmu_inputs row(std::size_t k) const {
    return {&force[k * tendons], &position[k * tendons], &angle[k * joints], &velocity[k * joints]};
  }
  tendonfmu_inputs all() const { return row(0); }
};

// Room for all outputs of some samples, by the names of tendonfmu_outputs. What is not written stays NaN, 9, -9.
struct Outputs {
  template <class Number>
  using Rows = std::map<std::string_view, std::vector<Number>>;

  Rows<double> real;
  Rows<unsigned char> flag;
  Rows<int> whole;

  explicit Outputs(std::size_t samples, std::size_t n = joints, std::size_t m = tendons) {
    tendonfmu_outputs unused = {};
    tendonfmu::detail::for_each_output({}, unused, n, m, [&](const char* name, auto, auto* array, std::size_t size) {
      rows(array)[name].assign(samples * size, unwritten(array));
    });
  }
  tendonfmu_outputs view() {
    tendonfmu_outputs all = {};
    tendonfmu::detail::for_each_output(
        {}, all, joints, tendons,
        [&](const char* name, auto, auto*& array, std::size_t) { array = rows(array).at(name).data(); });
    return all;
  }
  bool operator==(const Outputs& o) const { return real == o.real && flag == o.flag && whole == o.whole; }

 private:
  Rows<double>& rows(const double*) { return real; }
  Rows<unsigned char>& rows(const unsigned char*) { return flag; }
  Rows<int>& rows(const int*) { return whole; }
  static double unwritten(const double*) { return NAN; }
  static unsigned char unwritten(const unsigned char*) { return 9; }
  static int unwritten(const int*) { return -9; }
};

// A created finger that frees itself.
struct Finger {
  tendonfmu_finger* handle;

  explicit Finger(const std::vector<unsigned char>& bytes = image()) {
    char message[400] = "";
    handle = tendonfmu_create(bytes.data(), bytes.size(), message, sizeof message);
    if (handle == nullptr) {
      std::fprintf(stderr, "finger refused: %s\n", message);
      std::abort();
    }
  }
  ~Finger() { tendonfmu_destroy(handle); }
  Finger(const Finger&) = delete;
  Finger& operator=(const Finger&) = delete;
  operator tendonfmu_finger*() const { return handle; }

  // the first sample, or one more
  tendonfmu_status take(double time, const tendonfmu_inputs& inputs) const {
    return tendonfmu_is_initialised(handle) ? tendonfmu_step(handle, time, &inputs)
                                            : tendonfmu_initialise(handle, time, &inputs);
  }
  // samples from..to of a motion
  Outputs run(const Motion& motion, std::size_t from, std::size_t to) const {
    Outputs outputs(to - from);
    const tendonfmu_outputs view = outputs.view();
    const tendonfmu_inputs inputs = motion.row(from);
    if (tendonfmu_run(handle, to - from, &motion.time[from], &inputs, &view, nullptr) != TENDONFMU_OK) {
      std::fprintf(stderr, "sample refused: %s\n", tendonfmu_last_error(handle));
      std::abort();
    }
    return outputs;
  }
  Outputs run(const Motion& motion) const { return run(motion, 0, motion.time.size()); }

  std::vector<unsigned char> saved() const {
    std::vector<unsigned char> bytes(tendonfmu_state_size(handle));
    tendonfmu_save_state(handle, bytes.data(), bytes.size());
    return bytes;
  }
};

// Those that this processor has.
inline std::vector<const char*> kernels() {
  const Finger finger;
  std::vector<const char*> found;
  for (const char* kernel : {"plain", "sse2", "avx2", "neon"}) {
    if (tendonfmu_set_kernel(finger, kernel) == TENDONFMU_OK) {
      found.push_back(kernel);
    }
  }
  return found;
}

}  // namespace test_finger
