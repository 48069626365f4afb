// Any bytes as a rig: refused in one printable line, or a simulated finger that moves, gives up in one line, and whose
// saved states come back. Inputs are mutated as JSON, value by value: bytes alone would rarely stay a rig.
#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "../tests/test_plant.h"
#include "promises.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

using json_tree = nlohmann::json;
using test_plant::Plant;
using steady_clock = std::chrono::steady_clock;

constexpr double longest_settle = 0.003;     // s: work for nothing
constexpr std::chrono::seconds patience{2};  // no more calls after that
// A call that takes longer hangs: less than libFuzzer's own limit, more than all the steps that an advance may take
// (50,000) of a stiff finger in a sanitized build.
constexpr std::chrono::seconds longest_call{50};
constexpr std::size_t most_joints = 6, most_tendons = 12;  // larger fingers are only read

/* OK, or the solver gave up and says so. Nothing else may come of a rig that was accepted. */
bool moved(const Plant& plant, tendonfmu_plant_status status, steady_clock::time_point call) {
  PROMISE(steady_clock::now() - call < longest_call);
  PROMISE(status == TENDONFMU_PLANT_OK || status == TENDONFMU_PLANT_SOLVER);
  if (status != TENDONFMU_PLANT_OK) {
    promises::is_one_line(plant.error().c_str());
    return false;
  }
  test_plant::Signals signals(plant);
  PROMISE(tendonfmu_plant_get_signals(plant, &signals.view) == TENDONFMU_PLANT_OK);
  for (const std::vector<double>& row : signals.real) {
    PROMISE(std::all_of(row.begin(), row.end(), [](double x) { return std::isfinite(x); }));
  }
  for (std::size_t i = 0; i < plant.tendons(); ++i) {
    PROMISE(signals.view.tendon_force[i] >= 0.0 && signals.view.slack[i] <= 1);
  }
  return true;
}

bool advanced(const Plant& plant, double time) {
  const steady_clock::time_point call = steady_clock::now();
  return moved(plant, tendonfmu_plant_advance(plant, time), call);
}

/* A few samples with a push; a failed call changes nothing, a restored state goes the same way. */
void can_be_moved(Plant& plant, steady_clock::time_point begin) {
  const auto is_late = [begin] { return steady_clock::now() - begin > patience; };
  const tendonfmu_plant_inputs push = {nullptr, 0.5, {0.1, -0.2, 0.3}};
  for (int k = 1; k <= 4 && !is_late(); ++k) {
    if (k == 2) {
      PROMISE(tendonfmu_plant_set_inputs(plant, &push) == TENDONFMU_PLANT_OK);
    }
    const test_plant::Bytes before = plant.saved();
    const double time = plant.time();
    if (!advanced(plant, 1e-3 * k)) {
      PROMISE(plant.time() == time && plant.saved() == before);
      return;
    }
  }
  const test_plant::Bytes here = plant.saved();
  test_plant::Bytes ends[2];
  for (test_plant::Bytes& end : ends) {
    if (is_late()) {
      return;
    }
    PROMISE(plant.restore(here) == TENDONFMU_PLANT_OK);
    PROMISE(plant.saved() == here);
    advanced(plant, 5e-3);
    end = plant.saved();
  }
  PROMISE(ends[0] == ends[1]);
}

/* A rig that was accepted, with a tight and a rough tolerance. */
void can_be_used(const json_tree& rig) {
  Plant plant(rig);
  for (const double tolerance : {9e-6, 1e-3}) {
    const steady_clock::time_point begin = steady_clock::now();
    PROMISE(tendonfmu_plant_reset(plant) == TENDONFMU_PLANT_OK);
    tendonfmu_plant_settings settings = plant.settings();
    settings.relative_tolerance = tolerance;
    PROMISE(tendonfmu_plant_set_settings(plant, &settings) == TENDONFMU_PLANT_OK);
    const bool good = moved(plant, tendonfmu_plant_initialise(plant), begin);
    PROMISE(tendonfmu_plant_is_initialised(plant) == good);
    if (good) {
      can_be_moved(plant, begin);
    }
    if (steady_clock::now() - begin > patience) {
      return;
    }
  }
}

// --- mutations of JSON ---

/* A value somewhere within `value`. */
json_tree* anywhere(json_tree* value, std::mt19937& random) {
  while (value->is_structured() && !value->empty() && random() % 12) {
    auto item = value->begin();
    std::advance(item, static_cast<std::ptrdiff_t>(random() % value->size()));
    value = &*item;
  }
  return value;
}

double other_number(double x, std::mt19937& random) {
  const double special[] = {0.0,  -0.0, 1.0, -1.0, 1e-320, 5e-324, 1e-300, 1e-12, 1e-6, 0.05,
                            10.0, 1e3,  1e6, 1e9,  1e15,   1e300,  -1e300, 2.0,   3.0,  9007199254740993.0};
  switch (random() % 4) {
    case 0: return special[random() % std::size(special)];
    case 1: return -x;
    case 2: return x * std::pow(10.0, static_cast<double>(random() % 24) - 12.0);
    default: return x + 1.0;
  }
}

/* Another number, an element less or twice, or any other value. */
void change(json_tree* value, std::mt19937& random) {
  static const json_tree others =
      json_tree::parse(R"([null, true, 0, 1, -1.5, "", "sine", "link", "capstan", [], {}, [0, 0, 0], [1, 2]])");
  if (value->is_number() && random() % 8) {
    *value = other_number(value->get<double>(), random);
  } else if (value->is_structured() && !value->empty() && random() % 4) {
    auto item = value->begin();
    std::advance(item, static_cast<std::ptrdiff_t>(random() % value->size()));
    if (value->is_array() && random() % 2) {
      value->push_back(json_tree(*item));
    } else {
      value->erase(item);
    }
  } else {
    *value = others[random() % others.size()];
  }
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  std::mt19937 random(seed);
  json_tree rig = json_tree::parse(data, data + size, nullptr, false);
  if (rig.is_discarded() || !rig.is_structured() || random() % 20 == 0) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  for (unsigned k = 1 + random() % 3; k > 0; --k) {
    change(anywhere(&rig, random), random);
  }
  const std::string text = rig.dump(-1, ' ', false, json_tree::error_handler_t::replace);
  if (text.size() > max_size) {
    return LLVMFuzzerMutate(data, size, max_size);
  }
  std::memcpy(data, text.data(), text.size());
  return text.size();
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  char message[400] = "";
  tendonfmu_plant* plant = tendonfmu_plant_create(text.data(), size, message, sizeof message);
  if (!plant) {
    promises::is_one_line(message);
    return 0;
  }
  PROMISE(std::strlen(message) == 0);
  const bool is_small =
      tendonfmu_plant_joint_count(plant) <= most_joints && tendonfmu_plant_tendon_count(plant) <= most_tendons;
  tendonfmu_plant_destroy(plant);
  if (is_small) {
    json_tree rig = json_tree::parse(text);
    const json_tree settle = rig.value("settle", json_tree());
    rig["settle"] = std::min(settle.is_number() ? settle.get<double>() : 1.0, longest_settle);
    can_be_used(rig);
  }
  return 0;
}
