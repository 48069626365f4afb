// FMUs of simulated fingers: the rig of the tests, and it with a rough tolerance, and without sensors.
#include "../tests/test_plant.h"
#include "fuzzed_models.hpp"

namespace {

promises::byte_list rig(const std::vector<std::pair<std::string, test_plant::Json>>& changes) {
  const std::string text = test_plant::changed(changes).dump();
  return {text.begin(), text.end()};
}

}  // namespace

const double calls::longest_step = 0.02;

std::vector<promises::byte_list> calls::resources() {
  const std::pair<std::string, test_plant::Json> settle = {"/settle", longest_step};
  return {rig({settle}), rig({settle, {"/integration/relative_tolerance", 1e-4}}),
          rig({settle, {"/sensors", test_plant::Json::object()}})};
}
