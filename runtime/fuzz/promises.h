// What tendonfmu.h promises for every finger and every call, as checks that end a fuzzer.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "../tests/test_finger.h"

#define PROMISE(condition)                                                         \
  do {                                                                             \
    if (!(condition)) {                                                            \
      std::fprintf(stderr, "%s:%d: broken: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                \
    }                                                                              \
  } while (0)

namespace promises {

using byte_list = std::vector<unsigned char>;

inline byte_list saved(const tendonfmu_finger* finger) {
  byte_list bytes(tendonfmu_state_size(finger));
  PROMISE(tendonfmu_save_state(finger, bytes.data(), bytes.size()) == TENDONFMU_OK);
  return bytes;
}

// Real outputs are finite, flags 0 or 1, the link one of the finger. Rows that are not written are zeros.
struct output_room : test_finger::Outputs {
  int last_link;

  output_room(const tendonfmu_finger* finger, std::size_t samples)
      : Outputs(samples, tendonfmu_joint_count(finger), tendonfmu_tendon_count(finger)),
        last_link(static_cast<int>(tendonfmu_joint_count(finger))) {
    clear(real);
    clear(flag);
    clear(whole);
  }
  void check() const {
    for (const auto& [name, row] : real) {
      PROMISE(std::all_of(row.begin(), row.end(), [](double x) { return std::isfinite(x); }));
    }
    for (const auto& [name, row] : flag) {
      PROMISE(std::all_of(row.begin(), row.end(), [](unsigned char x) { return x <= 1; }));
    }
    for (const int link : whole.at("contact_link")) {
      PROMISE(link >= -1 && link <= last_link);
    }
  }

 private:
  template <class Rows>
  static void clear(Rows& rows) {
    for (auto& [name, row] : rows) {
      row.assign(row.size(), 0);
    }
  }
};

inline void outputs_are_finite(const tendonfmu_finger* finger) {
  output_room outputs(finger, 1);
  const tendonfmu_outputs view = outputs.view();
  PROMISE(tendonfmu_get_outputs(finger, &view) == TENDONFMU_OK);
  outputs.check();
}

// one printable line
inline void is_one_line(const char* text) {
  PROMISE(std::strlen(text) > 0);
  for (const char* c = text; *c; ++c) {
    PROMISE(static_cast<unsigned char>(*c) >= 0x20);
  }
}

// Parameters, some from all over the list, are in their ranges and found under their paths.
inline void parameters_are_sound(const tendonfmu_finger* finger) {
  const std::size_t count = tendonfmu_parameter_count(finger);
  for (std::size_t i = 0; i < count; i += 1 + count / 6) {
    char path[80];
    tendonfmu_parameter_info info;
    double value = NAN;
    PROMISE(tendonfmu_get_parameter_path(finger, i, path, sizeof path) == TENDONFMU_OK);
    PROMISE(tendonfmu_find_parameter(finger, path) == i);
    PROMISE(tendonfmu_get_parameter_info(finger, i, &info) == TENDONFMU_OK);
    PROMISE(tendonfmu_get_parameters(finger, 1, &i, &value) == TENDONFMU_OK);
    PROMISE(info.above_minimum ? value > info.minimum : value >= info.minimum);
    PROMISE(value <= info.maximum);
  }
}

// A finger moved through some samples, back and forth and at rest, by each kinematics source.
inline void finger_can_be_used(const byte_list& image) {
  char message[400] = "";
  tendonfmu_finger* finger = tendonfmu_create(image.data(), image.size(), message, sizeof message);
  PROMISE((finger == nullptr) == (std::strlen(message) > 0));
  if (!finger) {
    return;
  }
  parameters_are_sound(finger);
  const std::size_t n = tendonfmu_joint_count(finger), m = tendonfmu_tendon_count(finger);
  for (int source = 1; source <= 3; ++source) {
    PROMISE(tendonfmu_reset(finger) == TENDONFMU_OK);
    PROMISE(tendonfmu_set_kinematics_source(finger, source) == TENDONFMU_OK);
    for (int k = 0; k < 8; ++k) {
      const double sign = k < 3 ? 1.0 : k < 5 ? 0.0 : -1.0;
      const std::vector<double> force(m, 10.0 + k), position(m, 0.003 + 1e-4 * sign * k);
      const std::vector<double> angle(n, 0.01 * sign * k), velocity(n, sign);
      const tendonfmu_inputs inputs = {force.data(), position.data(), angle.data(), velocity.data()};
      const byte_list before = saved(finger);
      const tendonfmu_status status =
          k ? tendonfmu_step(finger, 0.01 * k, &inputs) : tendonfmu_initialise(finger, 0.0, &inputs);
      PROMISE(status == TENDONFMU_OK || status == TENDONFMU_BAD_SAMPLE); /* numbers at the ends may overflow */
      if (status != TENDONFMU_OK) {
        is_one_line(tendonfmu_last_error(finger));
        PROMISE(saved(finger) == before);
        break;
      }
      outputs_are_finite(finger);
    }
  }
  const byte_list bytes = saved(finger);
  PROMISE(tendonfmu_reset(finger) == TENDONFMU_OK);
  PROMISE(tendonfmu_restore_state(finger, bytes.data(), bytes.size()) == TENDONFMU_OK);
  PROMISE(saved(finger) == bytes);
  tendonfmu_destroy(finger);
}

}  // namespace promises
