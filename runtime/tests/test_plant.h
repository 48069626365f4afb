// The rig of the tests of the simulated finger, every effect in it, and what they make of it.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "rig.h"
#include "tendonfmu_plant.h"

namespace test_plant {

using Json = nlohmann::json;
using Bytes = std::vector<unsigned char>;

/* runtime/tests/small_rig.json */
inline Json small() {
  std::ifstream file(TENDONFMU_SMALL_RIG);
  return Json::parse(file);
}

/* The small rig with values replaced: {"/physics/friction/preload", 0.0}, ... */
inline Json changed(const std::vector<std::pair<std::string, Json>>& changes) {
  Json rig = small();
  for (const auto& [pointer, value] : changes) {
    rig[Json::json_pointer(pointer)] = value;
  }
  return rig;
}

inline tendonfmu::plant::rig read(const Json& rig) {
  const std::string text = rig.dump();
  return tendonfmu::plant::read_rig(text.data(), text.size());
}

/* `joints` links of one axis and `tendons` tendons in antagonist pairs; no friction, gravity or stops in reach. */
inline Json plain(std::size_t joints, std::size_t tendons) {
  Json rig = {{"format", "tendonfmu-rig-1"}, {"name", "plain"}, {"version", 1}, {"settle", 0.1}};
  Json& finger = rig["finger"] = {{"format", "tendonfmu-finger-1"}, {"name", "plain"}};
  Json& physics = rig["physics"] = {{"gravity", {0, 0, 0}}, {"tip", {0.04, 0, 0}}};
  rig["motion"]["pretension"] = {{"time", {0}}, {"value", {10}}};
  for (std::size_t j = 0; j < joints; ++j) {
    finger["joints"].push_back(Json::object());
    finger["contact"]["threshold"].push_back(0.05);
    physics["links"].push_back({{"axis", {0, 1, 0}},
                                {"offset", {j ? 0.04 : 0.0, 0, 0}},
                                {"mass", 0.02},
                                {"centre_of_mass", {0.02, 0, 0}},
                                {"inertia", {1e-6, 4e-6, 4e-6}}});
    rig["motion"]["joints"].push_back({{"time", {0}}, {"position", {0}}, {"velocity", {0}}, {"acceleration", {0}}});
  }
  std::mt19937 random(1);
  for (std::size_t i = 0; i < tendons; ++i) {
    Json arms;
    for (std::size_t j = 0; j < joints; ++j) {
      // pairs pull against each other; each pair has its own mixture
      const double arm = 0.004 + 1e-6 * static_cast<double>(random() % 4000) * ((i / 2 + j) % 2 ? 1.0 : -1.0);
      arms.push_back(i % 2 ? Json(-finger["tendons"][i - 1]["moment_arms"][j].get<double>()) : Json(arm));
    }
    finger["tendons"].push_back({{"stiffness", 8000}, {"moment_arms", arms}});
  }
  return rig;
}

/* As many joints and tendons as there may be, with every kind of effect. */
inline Json largest() {
  Json rig = plain(16, 64);
  const Json law = {{"static", 0.003}, {"coulomb", 0.002}, {"stribeck_velocity", 0.005}};
  const Json weak = {{"static", 1e-4}, {"coulomb", 1e-4}, {"stribeck_velocity", 0.1}};
  for (Json& tendon : rig["finger"]["tendons"]) {
    for (int j = 0; j < 16; ++j) {
      tendon["edge_friction"].push_back(law);
      if (j < 15) {
        tendon["pulley_friction"].push_back(law);
      }
    }
  }
  for (Json& joint : rig["finger"]["joints"]) {
    joint = {{"friction", weak}, {"load_friction", {{"static", 1e-6}, {"coulomb", 1e-6}, {"stribeck_velocity", 0.1}}}};
  }
  rig["physics"]["wrist"] = {
      {"amplitude", 0.1}, {"period", 5}, {"arms", std::vector<double>(64, 0.001)}, {"friction", law}};
  rig["physics"]["friction"] = {
      {"heat", {{"coefficient", 0.01}}},
      {"edges", {{{"tendon", 64}, {"joint", 16}, {"shape", "sine"}, {"rest", 0.5}, {"coefficient", 0.01}}}}};
  rig["physics"]["obstacle"] = {{"centre", {0.64, 0, 0}}, {"radius", 0.01}, {"stiffness", 100}};
  rig["physics"]["joint_coupling"] = std::vector<double>(15, 0.01);
  return rig;
}

/* A plant that frees itself. */
struct Plant {
  tendonfmu_plant* handle;

  explicit Plant(const Json& rig = small()) {
    const std::string text = rig.dump();
    char message[400] = "";
    handle = tendonfmu_plant_create(text.data(), text.size(), message, sizeof message);
    if (!handle) {
      std::fprintf(stderr, "rig refused: %s\n", message);
      std::abort();
    }
  }
  ~Plant() { tendonfmu_plant_destroy(handle); }
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

  operator tendonfmu_plant*() const { return handle; }  // NOLINT: stands for it in calls

  std::size_t joints() const { return tendonfmu_plant_joint_count(handle); }
  std::size_t tendons() const { return tendonfmu_plant_tendon_count(handle); }
  std::string error() const { return tendonfmu_plant_last_error(handle); }
  double time() const { return tendonfmu_plant_get_time(handle); }

  tendonfmu_plant_settings settings() const {
    tendonfmu_plant_settings found;
    tendonfmu_plant_get_settings(handle, &found);
    return found;
  }
  Bytes saved() const {
    Bytes bytes(tendonfmu_plant_state_size(handle));
    if (tendonfmu_plant_save_state(handle, bytes.data(), bytes.size()) != TENDONFMU_PLANT_OK) {
      bytes.clear();
    }
    return bytes;
  }
  tendonfmu_plant_status restore(const Bytes& bytes) {
    return tendonfmu_plant_restore_state(handle, bytes.data(), bytes.size());
  }
  std::vector<double> state() const {
    std::vector<double> found(tendonfmu_plant_order(handle));
    tendonfmu_plant_get_continuous_state(handle, found.data());
    return found;
  }
};

/* Room for all signals of some samples. */
struct Signals {
  std::vector<std::vector<double>> real;
  std::vector<unsigned char> contact, slack;
  tendonfmu_plant_signals view{};

  explicit Signals(const Plant& plant, std::size_t samples = 1) {
    const std::size_t n = plant.joints(), m = plant.tendons();
    double** const arrays[] = {&view.measured_tendon_force,
                               &view.measured_tendon_position,
                               &view.tendon_force,
                               &view.tendon_position,
                               &view.measured_joint_position,
                               &view.measured_joint_velocity,
                               &view.measured_external_torque,
                               &view.joint_position,
                               &view.joint_velocity,
                               &view.joint_torque,
                               &view.friction_torque,
                               &view.external_torque,
                               &view.inertial_torque,
                               &view.stop_torque,
                               &view.contact_force,
                               &view.contact_point,
                               &view.tip_position,
                               &view.friction_level,
                               &view.energy};
    std::size_t number = 0;
    for (double** array : arrays) {
      const std::size_t size = number < 4 ? m : number < 14 ? n : number < 17 ? 3 : number < 18 ? 1 : 6;
      real.emplace_back(samples * size, -1e300);
      *array = real.back().data();
      ++number;
    }
    contact.assign(samples, 9);
    slack.assign(samples * m, 9);
    view.contact = contact.data();
    view.slack = slack.data();
  }
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;
  bool operator==(const Signals& o) const { return real == o.real && contact == o.contact && slack == o.slack; }
};

inline bool same(const Plant& one, const Plant& other) {
  Signals first(one), second(other);
  return tendonfmu_plant_get_signals(one, &first.view) == TENDONFMU_PLANT_OK &&
         tendonfmu_plant_get_signals(other, &second.view) == TENDONFMU_PLANT_OK && first == second &&
         one.state() == other.state() && one.time() == other.time();
}

}  // namespace test_plant
