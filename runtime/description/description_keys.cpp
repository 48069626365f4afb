/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "description_keys.h"

#include <map>

#include "core_inside.h"

namespace tendonfmu {

const std::vector<std::string>& keys_of(const std::string& object) {
  static const std::map<std::string, std::vector<std::string>> keys = {
    {"", {"format", "name", "joints", "tendons", "velocity_threshold", "velocity_filter_cutoff", "position_filter", "bias", "contact", "extensions", "links", "tip", "sensor_fault"}},
    {"joints", {"name", "cover", "friction", "load_friction"}},
    {"joints.cover", {"stiffness", "rest_angle"}},
    {"tendons", {"name", "stiffness", "moment_arms", "pulley_friction", "edge_friction", "bidirectional"}},
    {"tendons.edge_friction", {"angles"}},
    {"velocity_threshold", {"tendon", "joint", "hysteresis"}},
    {"position_filter", {"noise", "jerk_density"}},
    {"bias", {"drift_variance", "noise_std", "noise_std_per_force", "initial_variance", "forget_rate", "initial_torque", "noise_time", "start_share", "forgetting", "entry_load"}},
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

const std::vector<number_key>& numbers_of(const std::string& object) {
  static const std::map<std::string, std::vector<number_key>> numbers = {
    {"", {
      {"velocity_filter_cutoff", false, false, "Hz", 0},
      {"tip", false, false, "m", MODEL_HAS_LINKS},
    }},
    {"joints", {
    }},
    {"joints.cover", {
      {"stiffness", false, true, "N.m/rad", 0},
      {"rest_angle", false, false, "rad", 0},
    }},
    {"tendons", {
      {"stiffness", false, true, "N/m", 0},
      {"moment_arms", true, true, "m", 0},
    }},
    {"tendons.edge_friction", {
      {"angles", false, true, "rad", 0},
    }},
    {"velocity_threshold", {
      {"tendon", false, false, "m/s", 0},
      {"joint", false, false, "rad/s", 0},
      {"hysteresis", false, false, "1", MODEL_HAS_HYSTERESIS},
    }},
    {"position_filter", {
      {"noise", true, true, "rad", 0},
      {"jerk_density", false, false, "rad2/s5", 0},
    }},
    {"bias", {
      {"drift_variance", false, false, "N2.m2/s", 0},
      {"noise_std", false, false, "N.m", 0},
      {"noise_std_per_force", false, false, "N.m per N", 0},
      {"initial_variance", false, false, "N2.m2", MODEL_HAS_INITIAL_VARIANCE},
      {"forget_rate", false, false, "1/s", 0},
      {"initial_torque", true, false, "N.m", MODEL_HAS_INITIAL_TORQUE},
      {"noise_time", false, false, "s", MODEL_HAS_NOISE_TIME},
      {"start_share", false, false, "1", MODEL_HAS_START_SHARE},
    }},
    {"contact", {
      {"threshold", true, true, "N.m", 0},
      {"threshold_per_force", true, false, "N.m per N", 0},
      {"uncertainty", false, false, "1", MODEL_HAS_UNCERTAINTY},
      {"uncertainty_level", false, false, "1", MODEL_HAS_UNCERTAINTY},
      {"deviation", true, false, "N.m", MODEL_HAS_DEVIATION},
      {"deviation_per_force", true, false, "N.m per N", MODEL_HAS_DEVIATION},
      {"release_ratio", false, false, "1", MODEL_HAS_RELEASE},
      {"hold_time", false, false, "s", MODEL_HAS_RELEASE},
      {"release_time", false, false, "s", MODEL_HAS_RELEASE_TIME},
    }},
    {"contact.innovation", {
      {"time", false, true, "s", 0},
      {"threshold", true, true, "N.m", 0},
      {"threshold_per_force", true, false, "N.m per N", 0},
      {"evidence_time", false, false, "s", MODEL_DETECTS_BY_CUSUM},
    }},
    {"contact.friction_bound", {
      {"stuck_share", false, false, "1", 0},
      {"stuck_time", false, false, "s", 0},
      {"jump_share", false, false, "1", 0},
      {"jump_time", false, false, "s", 0},
    }},
    {"contact.drift", {
      {"quick_time", false, false, "s", 0},
      {"slow_time", false, false, "s", 0},
      {"threshold", true, true, "N.m", 0},
      {"threshold_per_force", true, false, "N.m per N", 0},
    }},
    {"contact.rest", {
      {"travel", false, true, "m", 0},
      {"settle_time", false, false, "s", 0},
      {"averaging_time", false, false, "s", 0},
      {"threshold", true, true, "N.m", 0},
      {"threshold_per_force", true, false, "N.m per N", 0},
      {"creep", true, false, "N.m", 0},
      {"fall_share", false, false, "1", 0},
    }},
    {"contact.rest.innovation", {
      {"time", false, true, "s", 0},
      {"threshold", true, true, "N.m", 0},
    }},
    {"links", {
      {"axis", false, true, "1", MODEL_HAS_LINKS},
      {"offset", false, false, "m", MODEL_HAS_LINKS},
    }},
    {"sensor_fault", {
      {"hold_time", false, false, "s", 0},
      {"force_resolution", false, false, "N", 0},
      {"position_resolution", false, false, "m", 0},
      {"jump_margin", false, false, "N", 0},
      {"recovery_time", false, false, "s", 0},
    }},
  };
  return numbers.at(object);
}

}  // namespace tendonfmu
