// A small valid description to be changed, and what becomes of it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tendonfmu_description.h"

// Two joints, two tendons, one of everything that a description may leave out.
inline nlohmann::json small_finger() {
  return nlohmann::json::parse(R"({
    "format": "tendonfmu-finger-1",
    "name": "small",
    "joints": [
      {"name": "base", "cover": {"stiffness": 0.02, "rest_angle": 0.1},
       "friction": {"static": 0.008, "coulomb": 0.006, "stribeck_velocity": 0.1, "viscous": 0.001},
       "load_friction": {"static": 1e-4, "coulomb": 8e-5, "stribeck_velocity": 0.1, "viscous": 1e-6}},
      {}
    ],
    "tendons": [
      {"name": "flexor", "stiffness": 4000, "moment_arms": [0.009, 0.004], "bidirectional": false,
       "pulley_friction": [{"static": 0.02, "coulomb": 0.015, "stribeck_velocity": 0.004, "viscous": 0.1}, null],
       "edge_friction": [
         {"positive": {"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005, "viscous": 0.3},
          "negative": {"static": 0.04, "coulomb": 0.03, "stribeck_velocity": 0.006, "viscous": 0.4}},
         {"angles": [-0.5, 0.5],
          "laws": [{"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005},
                   {"static": 0.05, "coulomb": 0.04, "stribeck_velocity": 0.005}]}]},
      {"stiffness": 5000, "moment_arms": [-0.009, 0.003]}
    ],
    "velocity_threshold": {"tendon": 0.0004, "joint": 0.02},
    "velocity_filter_cutoff": 25,
    "bias": {"drift_variance": 2e-6, "noise_std": 0.02, "noise_std_per_force": 1e-4, "initial_variance": 1e-4,
             "forget_rate": 4, "initial_torque": [0.1, -0.2], "noise_time": 0.01},
    "contact": {"threshold": [0.03, 0.04], "threshold_per_force": [1e-4, 2e-4]},
    "extensions": [{"effect": "cover_hardening", "joint": 2, "stiffness": 0.3}]
  })");
}

// What tendonfmu_image_from_json() makes of a text.
struct Reading {
  tendonfmu_status status;
  std::string message;
  std::vector<unsigned char> image;
};

inline Reading read(const std::string& text) {
  void* block = nullptr;
  std::size_t size = 0;
  char message[400] = "";
  Reading result;
  result.status = tendonfmu_image_from_json(text.data(), text.size(), &block, &size, message, sizeof message);
  result.message = message;
  if (block) {
    const auto* bytes = static_cast<const unsigned char*>(block);
    result.image.assign(bytes, bytes + size);
  }
  tendonfmu_free_image(block);
  return result;
}

inline Reading read(const nlohmann::json& description) {
  return read(description.dump());
}
