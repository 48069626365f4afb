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
    {"bias", {"drift_variance", "noise_std", "noise_std_per_force", "initial_variance", "forget_rate", "initial_torque", "noise_time", "start_share", "forgetting"}},
    {"contact", {"threshold", "threshold_per_force", "method", "innovation", "friction_bound", "uncertainty", "uncertainty_level", "deviation", "deviation_per_force", "release_ratio", "hold_time", "release_time", "drift", "rest"}},
    {"contact.innovation", {"time", "threshold", "threshold_per_force", "evidence_time"}},
    {"contact.friction_bound", {"stuck_share", "stuck_time", "stuck_presliding", "jump_share", "jump_time"}},
    {"contact.drift", {"quick_time", "slow_time", "threshold", "threshold_per_force"}},
    {"contact.rest", {"travel", "settle_time", "averaging_time", "threshold", "threshold_per_force", "creep", "fall_share", "innovation"}},
    {"contact.rest.innovation", {"time", "threshold"}},
    {"links", {"axis", "offset"}},
    {"sensor_fault", {"hold_time", "force_resolution", "position_resolution", "jump_margin", "recovery_time"}},
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
    {"contact.method", {"threshold", "innovation", "cusum"}},
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
    {"bias", {"start_share", false, false, "1", MODEL_HAS_START_SHARE}},
    {"contact", {"threshold", true, true, "N.m", 0}},
    {"contact", {"threshold_per_force", true, false, "N.m per N", 0}},
    {"contact", {"uncertainty", false, false, "1", MODEL_HAS_UNCERTAINTY}},
    {"contact", {"uncertainty_level", false, false, "1", MODEL_HAS_UNCERTAINTY}},
    {"contact", {"deviation", true, false, "N.m", MODEL_HAS_DEVIATION}},
    {"contact", {"deviation_per_force", true, false, "N.m per N", MODEL_HAS_DEVIATION}},
    {"contact", {"release_ratio", false, false, "1", MODEL_HAS_RELEASE}},
    {"contact", {"hold_time", false, false, "s", MODEL_HAS_RELEASE}},
    {"contact", {"release_time", false, false, "s", MODEL_HAS_RELEASE_TIME}},
    {"contact.innovation", {"threshold", true, true, "N.m", 0}},
    {"contact.innovation", {"threshold_per_force", true, false, "N.m per N", 0}},
    {"contact.innovation", {"evidence_time", false, false, "s", MODEL_DETECTS_BY_CUSUM}},
    {"contact.drift", {"threshold", true, true, "N.m", 0}},
    {"contact.drift", {"threshold_per_force", true, false, "N.m per N", 0}},
    {"contact.rest", {"threshold", true, true, "N.m", 0}},
    {"contact.rest", {"threshold_per_force", true, false, "N.m per N", 0}},
    {"contact.rest", {"creep", true, false, "N.m", 0}},
    {"contact.rest.innovation", {"threshold", true, true, "N.m", 0}},
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
