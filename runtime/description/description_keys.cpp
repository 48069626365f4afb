/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "description_keys.h"

namespace tendonfmu {

const std::vector<key_fact>& key_facts() {
  static const std::vector<key_fact> facts = {
    {"", "format", key_kind::format, true, 0, 0, 0, "", {}},
    {"", "name", key_kind::name, true, 0, 0, 0, "", {}},
    {"", "joints", key_kind::list, true, 0, 1, 16, "joints", {}},
    {"", "tendons", key_kind::list, true, 0, 1, 64, "tendons", {}},
    {"", "velocity_threshold", key_kind::object, false, 0, 0, 0, "", {}},
    {"", "velocity_filter_cutoff", key_kind::number, false, 0, 0, 0, "", {}},
    {"", "bias", key_kind::object, false, 0, 0, 0, "", {}},
    {"", "contact", key_kind::object, true, 0, 0, 0, "", {}},
    {"", "extensions", key_kind::extensions, false, 0, 0, 0, "", {}},
    {"", "links", key_kind::list, false, MODEL_HAS_LINKS, 0, 0, "links, one per joint", {}},
    {"", "tip", key_kind::vector, false, MODEL_HAS_LINKS, 0, 0, "numbers in m, the fingertip in the last link's frame", {}},
    {"", "sensor_fault", key_kind::object, false, MODEL_HAS_SENSOR_FAULT, 0, 0, "", {}},
    {"", "estimated", key_kind::estimates, false, 0, 0, 0, "", {}},
    {"joints", "name", key_kind::name, false, 0, 0, 0, "", {}},
    {"joints", "cover", key_kind::object, false, 0, 0, 0, "", {}},
    {"joints", "friction", key_kind::law, false, 0, 0, 0, "", {}},
    {"joints", "load_friction", key_kind::law, false, 0, 0, 0, "", {}},
    {"joints.cover", "stiffness", key_kind::number, true, 0, 0, 0, "", {}},
    {"joints.cover", "rest_angle", key_kind::number, false, 0, 0, 0, "", {}},
    {"tendons", "name", key_kind::name, false, 0, 0, 0, "", {}},
    {"tendons", "stiffness", key_kind::number, true, 0, 0, 0, "", {}},
    {"tendons", "moment_arms", key_kind::per_joint, true, 0, 0, 0, "numbers in m, one per joint", {}},
    {"tendons", "zero", key_kind::number, false, MODEL_HAS_TENDON_ZERO, 0, 0, "", {}},
    {"tendons", "pulley_friction", key_kind::laws, false, 0, 0, 0, "", {}},
    {"tendons", "edge_friction", key_kind::edges, false, 0, 0, 0, "", {}},
    {"tendons", "bidirectional", key_kind::flag, false, 0, 0, 0, "", {}},
    {"velocity_threshold", "tendon", key_kind::number, false, 0, 0, 0, "", {}},
    {"velocity_threshold", "joint", key_kind::number, false, 0, 0, 0, "", {}},
    {"bias", "drift_variance", key_kind::number, false, 0, 0, 0, "", {}},
    {"bias", "noise_std", key_kind::number, false, 0, 0, 0, "", {}},
    {"bias", "noise_std_per_force", key_kind::number, false, 0, 0, 0, "", {}},
    {"bias", "initial_variance", key_kind::number, false, MODEL_HAS_INITIAL_VARIANCE, 0, 0, "", {}},
    {"bias", "forget_rate", key_kind::number, false, 0, 0, 0, "", {}},
    {"bias", "initial_torque", key_kind::per_joint, false, MODEL_HAS_INITIAL_TORQUE, 0, 0, "numbers in N.m, one per joint", {}},
    {"bias", "noise_time", key_kind::number, false, MODEL_HAS_NOISE_TIME, 0, 0, "", {}},
    {"bias", "forgetting", key_kind::word, false, MODEL_FORGETS_BY_ABSORPTION, 0, 0, "", {"time", "absorption"}},
    {"contact", "threshold", key_kind::per_joint, true, 0, 0, 0, "numbers in N.m, one per joint", {}},
    {"contact", "threshold_per_force", key_kind::per_joint, false, 0, 0, 0, "numbers in N.m per N, one per joint", {}},
    {"contact", "method", key_kind::word, false, 0, 0, 0, "", {"paper", "bands"}},
    {"contact", "watches_motors", key_kind::flag, false, MODEL_WATCHES_MOTORS, 0, 0, "", {}},
    {"contact", "bands", key_kind::list, false, MODEL_DETECTS_BY_BANDS, 4, 4, "objects with the numbers of each band", {}},
    {"contact", "deviation", key_kind::per_joint, false, MODEL_HAS_DEVIATION, 0, 0, "numbers in N.m, one per joint", {}},
    {"contact", "deviation_per_force", key_kind::per_joint, false, MODEL_HAS_DEVIATION, 0, 0, "numbers in N.m per N, one per joint", {}},
    {"contact.bands", "noise", key_kind::per_joint, true, MODEL_DETECTS_BY_BANDS, 0, 0, "numbers in N.m, one per joint", {}},
    {"contact.bands", "friction", key_kind::per_joint, false, MODEL_DETECTS_BY_BANDS, 0, 0, "numbers in 1, one per joint", {}},
    {"contact.bands", "friction_limit", key_kind::per_joint, false, MODEL_DETECTS_BY_BANDS, 0, 0, "numbers in 1, one per joint", {}},
    {"contact.bands", "motor_load", key_kind::per_joint, false, MODEL_DETECTS_BY_BANDS, 0, 0, "numbers in 1, one per joint", {}},
    {"contact.bands", "friction_change", key_kind::per_joint, false, MODEL_DETECTS_BY_BANDS, 0, 0, "numbers in 1, one per joint", {}},
    {"contact.bands", "friction_reserve", key_kind::per_joint, false, MODEL_DETECTS_BY_BANDS, 0, 0, "numbers in 1, one per joint", {}},
    {"links", "axis", key_kind::vector, true, MODEL_HAS_LINKS, 0, 0, "numbers, the direction of the joint's axis", {}},
    {"links", "offset", key_kind::vector, false, MODEL_HAS_LINKS, 0, 0, "numbers in m", {}},
    {"sensor_fault", "hold_time", key_kind::number, false, 0, 0, 0, "", {}},
    {"sensor_fault", "force_resolution", key_kind::number, false, 0, 0, 0, "", {}},
    {"sensor_fault", "position_resolution", key_kind::number, false, 0, 0, 0, "", {}},
    {"sensor_fault", "jump_margin", key_kind::number, false, 0, 0, 0, "", {}},
    {"sensor_fault", "spring_margin", key_kind::number, false, 0, 0, 0, "", {}},
    {"sensor_fault", "longest_stand", key_kind::number, false, 0, 0, 0, "", {}},
    {"sensor_fault", "recovery_time", key_kind::number, false, 0, 0, 0, "", {}},
  };
  return facts;
}

const std::vector<std::string>& law_keys() {
  static const std::vector<std::string> keys = {"static", "coulomb", "stribeck_velocity", "viscous"};
  return keys;
}

double default_of(model_item_kind kind) {
  switch (kind) {
    case ITEM_TENDON_THRESHOLD: return 0.0005;
    case ITEM_JOINT_THRESHOLD: return 0.01;
    case ITEM_FILTER_CUTOFF: return 20.0;
    case ITEM_DRIFT_VARIANCE: return 1e-06;
    case ITEM_NOISE_STD: return 0.01;
    case ITEM_FORGET_RATE: return 5.0;
    case ITEM_FAULT_HOLD_TIME: return 0.05;
    case ITEM_FAULT_FORCE_RESOLUTION: return 0.01;
    case ITEM_FAULT_POSITION_RESOLUTION: return 2e-06;
    case ITEM_FAULT_JUMP_MARGIN: return 1.0;
    case ITEM_FAULT_SPRING_MARGIN: return 1.0;
    case ITEM_FAULT_LONGEST_STAND: return 1000000000.0;
    case ITEM_FAULT_RECOVERY_TIME: return 0.5;
    default: return 0.0;
  }
}

}  // namespace tendonfmu
