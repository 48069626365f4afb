/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "description_keys.h"

#include <map>

#include "core_inside.h"

namespace tendonfmu {

const std::vector<std::string>& keys_of(const std::string& object) {
  static const std::map<std::string, std::vector<std::string>> keys = {
    {"", {"format", "name", "joints", "tendons", "velocity_threshold", "velocity_filter_cutoff", "bias", "contact", "extensions", "links", "tip", "sensor_fault", "estimated"}},
    {"joints", {"name", "cover", "friction", "load_friction"}},
    {"joints.cover", {"stiffness", "rest_angle"}},
    {"tendons", {"name", "stiffness", "moment_arms", "zero", "pulley_friction", "edge_friction", "bidirectional"}},
    {"tendons.edge_friction", {"angles"}},
    {"velocity_threshold", {"tendon", "joint"}},
    {"bias", {"drift_variance", "noise_std", "noise_std_per_force", "initial_variance", "forget_rate", "initial_torque", "noise_time", "forgetting"}},
    {"contact", {"threshold", "threshold_per_force", "method", "watches_motors", "bands", "deviation", "deviation_per_force"}},
    {"contact.bands", {"noise", "friction", "friction_limit", "motor_load", "friction_change", "friction_reserve"}},
    {"links", {"axis", "offset"}},
    {"sensor_fault", {"hold_time", "force_resolution", "position_resolution", "jump_margin", "spring_margin", "longest_stand", "recovery_time"}},
  };
  return keys.at(object);
}

const std::vector<std::string>& law_keys() {
  static const std::vector<std::string> keys = {"static", "coulomb", "stribeck_velocity", "viscous"};
  return keys;
}

const std::vector<std::string>& words_of(const std::string& path) {
  static const std::map<std::string, std::vector<std::string>> words = {
    {"bias.forgetting", {"time", "absorption"}},
    {"contact.method", {"paper", "bands"}},
  };
  return words.at(path);
}

std::vector<number_key> numbers_of(const std::string& object) {
  static const std::multimap<std::string, number_key> numbers = {
    {"", {"tip", false, false, "m", MODEL_HAS_LINKS}},
    {"tendons", {"moment_arms", true, true, "m", 0}},
    {"tendons", {"zero", false, false, "m", MODEL_HAS_TENDON_ZERO}},
    {"bias", {"initial_variance", false, false, "N2.m2", MODEL_HAS_INITIAL_VARIANCE}},
    {"bias", {"initial_torque", true, false, "N.m", MODEL_HAS_INITIAL_TORQUE}},
    {"bias", {"noise_time", false, false, "s", MODEL_HAS_NOISE_TIME}},
    {"contact", {"threshold", true, true, "N.m", 0}},
    {"contact", {"threshold_per_force", true, false, "N.m per N", 0}},
    {"contact", {"deviation", true, false, "N.m", MODEL_HAS_DEVIATION}},
    {"contact", {"deviation_per_force", true, false, "N.m per N", MODEL_HAS_DEVIATION}},
    {"contact.bands", {"noise", true, true, "N.m", MODEL_DETECTS_BY_BANDS}},
    {"contact.bands", {"friction", true, false, "1", MODEL_DETECTS_BY_BANDS}},
    {"contact.bands", {"friction_limit", true, false, "1", MODEL_DETECTS_BY_BANDS}},
    {"contact.bands", {"motor_load", true, false, "1", MODEL_DETECTS_BY_BANDS}},
    {"contact.bands", {"friction_change", true, false, "1", MODEL_DETECTS_BY_BANDS}},
    {"contact.bands", {"friction_reserve", true, false, "1", MODEL_DETECTS_BY_BANDS}},
    {"links", {"axis", false, true, "1", MODEL_HAS_LINKS}},
    {"links", {"offset", false, false, "m", MODEL_HAS_LINKS}},
  };
  std::vector<number_key> keys;
  for (auto [row, end] = numbers.equal_range(object); row != end; ++row) {
    keys.push_back(row->second);
  }
  return keys;
}

}  // namespace tendonfmu
