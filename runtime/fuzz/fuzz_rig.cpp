// Any bytes as a rig: refused in one printable line, or a simulated finger that moves, gives up in one line, and whose
// saved states come back. Inputs are mutated as JSON, value by value: bytes alone would rarely stay a rig.
#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "promises.h"
#include "tendonfmu_plant.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

using json_tree = nlohmann::json;
using steady_clock = std::chrono::steady_clock;

constexpr double longest_settle = 0.003;         // s: work for nothing
constexpr std::chrono::seconds patience{2};      // no more calls after that
constexpr std::chrono::seconds longest_call{8};  // a call that takes longer hangs: less than libFuzzer's own limit
constexpr std::size_t most_joints = 6, most_tendons = 12;  // larger fingers are only read

// --- what is checked ---

void one_line(const char* text) {
  PROMISE(std::strlen(text) > 0);
  for (const char* c = text; *c; ++c) {
    PROMISE(static_cast<unsigned char>(*c) >= 0x20);
  }
}

/* OK, or the solver gave up and says so. Nothing else may come of a rig that was accepted. */
bool moved(const tendonfmu_plant* plant, tendonfmu_plant_status status) {
  PROMISE(status == TENDONFMU_PLANT_OK || status == TENDONFMU_PLANT_SOLVER);
  if (status != TENDONFMU_PLANT_OK) {
    one_line(tendonfmu_plant_last_error(plant));
  }
  return status == TENDONFMU_PLANT_OK;
}

promises::byte_list saved_plant(const tendonfmu_plant* plant) {
  promises::byte_list bytes(tendonfmu_plant_state_size(plant));
  PROMISE(tendonfmu_plant_save_state(plant, bytes.data(), bytes.size()) == TENDONFMU_PLANT_OK);
  return bytes;
}

void signals_are_finite(const tendonfmu_plant* plant) {
  const std::size_t n = tendonfmu_plant_joint_count(plant), m = tendonfmu_plant_tendon_count(plant);
  std::vector<double> force(m, NAN), friction(n, NAN), inertial(n, NAN), energy(6, NAN), point(3, NAN);
  std::vector<unsigned char> slack(m, 9);
  tendonfmu_plant_signals wanted = {};
  wanted.tendon_force = force.data();
  wanted.friction_torque = friction.data();
  wanted.inertial_torque = inertial.data();
  wanted.energy = energy.data();
  wanted.contact_point = point.data();
  wanted.slack = slack.data();
  PROMISE(tendonfmu_plant_get_signals(plant, &wanted) == TENDONFMU_PLANT_OK);
  for (const auto* values : {&force, &friction, &inertial, &energy, &point}) {
    for (const double x : *values) {
      PROMISE(std::isfinite(x));
    }
  }
  for (const double x : force) {
    PROMISE(x >= 0.0);
  }
  for (const unsigned char flag : slack) {
    PROMISE(flag <= 1);
  }
}

/* A few samples with a push; a failed call changes nothing, a restored state goes the same way. */
void can_be_moved(tendonfmu_plant* plant, steady_clock::time_point begin) {
  const tendonfmu_plant_inputs push = {nullptr, 0.5, {0.1, -0.2, 0.3}};
  for (int k = 1; k <= 4; ++k) {
    if (steady_clock::now() - begin > patience) {
      return;
    }
    if (k == 2) {
      PROMISE(tendonfmu_plant_set_inputs(plant, &push) == TENDONFMU_PLANT_OK);
    }
    const promises::byte_list before = saved_plant(plant);
    const double time = tendonfmu_plant_get_time(plant);
    const steady_clock::time_point call = steady_clock::now();
    const bool good = moved(plant, tendonfmu_plant_advance(plant, 1e-3 * k));
    PROMISE(steady_clock::now() - call < longest_call);
    if (!good) {
      PROMISE(tendonfmu_plant_get_time(plant) == time);
      PROMISE(saved_plant(plant) == before);
      return;
    }
    signals_are_finite(plant);
  }
  const promises::byte_list here = saved_plant(plant);
  promises::byte_list ends[2];
  for (promises::byte_list& end : ends) {
    if (steady_clock::now() - begin > patience) {
      return;
    }
    PROMISE(tendonfmu_plant_restore_state(plant, here.data(), here.size()) == TENDONFMU_PLANT_OK);
    PROMISE(saved_plant(plant) == here);
    moved(plant, tendonfmu_plant_advance(plant, 5e-3));
    end = saved_plant(plant);
  }
  PROMISE(ends[0] == ends[1]);
}

/* A rig that is accepted, with each integrator. */
void can_be_used(const std::string& text) {
  char message[400] = "";
  tendonfmu_plant* plant = tendonfmu_plant_create(text.data(), text.size(), message, sizeof message);
  PROMISE(plant != nullptr); /* it was accepted before */
  for (const int integrator : {TENDONFMU_PLANT_CVODE, TENDONFMU_PLANT_FIXED_STEP}) {
    const steady_clock::time_point begin = steady_clock::now();
    tendonfmu_plant_settings settings;
    PROMISE(tendonfmu_plant_reset(plant) == TENDONFMU_PLANT_OK);
    PROMISE(tendonfmu_plant_get_settings(plant, &settings) == TENDONFMU_PLANT_OK);
    settings.integrator = integrator;
    settings.relative_tolerance = 1e-3;
    settings.step = 1e-3;
    PROMISE(tendonfmu_plant_set_settings(plant, &settings) == TENDONFMU_PLANT_OK);
    const bool good = moved(plant, tendonfmu_plant_initialise(plant));
    PROMISE(steady_clock::now() - begin < longest_call);
    PROMISE(tendonfmu_plant_is_initialised(plant) == good);
    if (!good) {
      continue;
    }
    signals_are_finite(plant);
    can_be_moved(plant, begin);
  }
  tendonfmu_plant_destroy(plant);
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

void change_number(json_tree* value, std::mt19937& random) {
  const double special[] = {0.0,  -0.0, 1.0, -1.0, 1e-320, 5e-324, 1e-300, 1e-12, 1e-6, 0.05,
                            10.0, 1e3,  1e6, 1e9,  1e15,   1e300,  -1e300, 2.0,   3.0,  9007199254740993.0};
  const double x = value->get<double>();
  switch (random() % 5) {
    case 0: *value = special[random() % std::size(special)]; break;
    case 1: *value = -x; break;
    case 2: *value = x * (random() % 2 ? 10.0 : 0.1); break;
    case 3: *value = x * std::pow(10.0, static_cast<double>(random() % 24) - 12.0); break;
    default: *value = x + 1.0;
  }
}

void change(json_tree* value, std::mt19937& random) {
  if (value->is_number() && random() % 8) {
    return change_number(value, random);
  }
  if (value->is_object() && !value->empty() && random() % 2) {
    auto item = value->begin();
    std::advance(item, static_cast<std::ptrdiff_t>(random() % value->size()));
    value->erase(item);
    return;
  }
  if (value->is_array() && !value->empty() && random() % 4) {
    const std::size_t k = random() % value->size();
    if (random() % 2) {
      value->push_back(json_tree((*value)[k]));
    } else {
      value->erase(k);
    }
    return;
  }
  const json_tree other[] = {nullptr,
                             true,
                             0,
                             1,
                             -1.5,
                             "",
                             "sine",
                             "link",
                             "capstan",
                             "fixed_step",
                             json_tree::array(),
                             json_tree::object(),
                             {0, 0, 0},
                             {1, 2}};
  *value = other[random() % std::size(other)];
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
  PROMISE((plant == nullptr) == (std::strlen(message) > 0));
  if (!plant) {
    one_line(message);
    return 0;
  }
  const bool is_small =
      tendonfmu_plant_joint_count(plant) <= most_joints && tendonfmu_plant_tendon_count(plant) <= most_tendons;
  tendonfmu_plant_destroy(plant);
  if (!is_small) {
    return 0;
  }
  json_tree rig = json_tree::parse(text);
  rig["settle"] =
      std::min(rig.value("settle", json_tree()).is_number() ? rig["settle"].get<double>() : 1.0, longest_settle);
  can_be_used(rig.dump());
  return 0;
}
