// Friction FMUs: the finger of the tests, one that watches its sensors, and one with every effect.
#include "../tests/test_finger.h"
#include "fuzzed_models.hpp"

const double calls::longest_step = HUGE_VAL;

std::vector<promises::byte_list> calls::resources() {
  return {test_finger::image(), test_finger::image(test_finger::watched_sensors()),
          test_finger::image(test_finger::every_effect())};
}
