/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "floating_point.h"

#include "key_table.h"


static const key_row rows[] = {
  {"joints[%j].cover.stiffness", "N.m/rad", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"joints[%j].cover.rest_angle", "rad", -1000000.0, 1000000.0, 0, 1, 1, KEY_ONE, 0},
  {"joints[%j].friction%~.static", "N.m", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"joints[%j].friction%~.coulomb", "N.m", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"joints[%j].friction%~.stribeck_velocity", "rad/s", 0.0, 1000000000.0, 1, 1, 0, KEY_ONE, 0},
  {"joints[%j].friction%~.viscous", "N.m.s/rad", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"joints[%j].load_friction%~.static", "m", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"joints[%j].load_friction%~.coulomb", "m", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"joints[%j].load_friction%~.stribeck_velocity", "rad/s", 0.0, 1000000000.0, 1, 1, 0, KEY_ONE, 0},
  {"joints[%j].load_friction%~.viscous", "m.s/rad", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"tendons[%i].stiffness", "N/m", 0.0, 1000000000000.0, 1, 0, 0, KEY_ONE, 0},
  {"tendons[%i].moment_arms[%k]", "m", -1000.0, 1000.0, 0, 0, 0, KEY_PER_JOINT, 0},
  {"tendons[%i].zero", "m", -1000.0, 1000.0, 0, 0, 1, KEY_ONE, MODEL_HAS_TENDON_ZERO},
  {"tendons[%i].pulley_friction[%j]%~.static", "1", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"tendons[%i].pulley_friction[%j]%~.coulomb", "1", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"tendons[%i].pulley_friction[%j]%~.stribeck_velocity", "m/s", 0.0, 1000000000.0, 1, 1, 0, KEY_ONE, 0},
  {"tendons[%i].pulley_friction[%j]%~.viscous", "s/m", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"tendons[%i].edge_friction[%j].angles[%k]", "rad", -1000000.0, 1000000.0, 0, 0, 0, KEY_ONE, 0},
  {"tendons[%i].edge_friction[%j]%@%~.static", "1", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"tendons[%i].edge_friction[%j]%@%~.coulomb", "1", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, 0},
  {"tendons[%i].edge_friction[%j]%@%~.stribeck_velocity", "m/s", 0.0, 1000000000.0, 1, 1, 0, KEY_ONE, 0},
  {"tendons[%i].edge_friction[%j]%@%~.viscous", "s/m", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"velocity_threshold.tendon", "m/s", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"velocity_threshold.joint", "rad/s", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"velocity_filter_cutoff", "Hz", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"bias.drift_variance", "N2.m2/s", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"bias.noise_std", "N.m", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"bias.noise_std_per_force", "m", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"bias.initial_variance", "N2.m2", 0.0, 1000000000.0, 0, 0, 0, KEY_ONE, MODEL_HAS_INITIAL_VARIANCE},
  {"bias.forget_rate", "1/s", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, 0},
  {"bias.initial_torque[%k]", "N.m", -1000000000.0, 1000000000.0, 0, 0, 0, KEY_PER_JOINT, MODEL_HAS_INITIAL_TORQUE},
  {"bias.noise_time", "s", 0.0, 1000000000.0, 0, 1, 0, KEY_ONE, MODEL_HAS_NOISE_TIME},
  {"contact.threshold[%k]", "N.m", 0.0, 1000000000.0, 0, 1, 0, KEY_PER_JOINT, 0},
  {"contact.threshold_per_force[%k]", "m", 0.0, 1000000000.0, 0, 1, 1, KEY_PER_JOINT, 0},
  {"contact.bands[%d].noise[%k]", "N.m", 0.0, 1000000000.0, 1, 1, 0, KEY_PER_JOINT, MODEL_DETECTS_BY_BANDS},
  {"contact.bands[%d].friction[%k]", "1", 0.0, 1000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_DETECTS_BY_BANDS},
  {"contact.bands[%d].friction_limit[%k]", "1", 0.0, 1000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_DETECTS_BY_BANDS},
  {"contact.bands[%d].motor_load[%k]", "1", 0.0, 1000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_DETECTS_BY_BANDS},
  {"contact.bands[%d].friction_change[%k]", "1", 0.0, 1000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_DETECTS_BY_BANDS},
  {"contact.bands[%d].friction_reserve[%k]", "1", 0.0, 1000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_DETECTS_BY_BANDS},
  {"contact.deviation[%k]", "N.m", 0.0, 1000000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_HAS_DEVIATION},
  {"contact.deviation_per_force[%k]", "m", 0.0, 1000000000.0, 0, 1, 1, KEY_PER_JOINT, MODEL_HAS_DEVIATION},
  {"links[%j].axis[%k]", "1", -1000000.0, 1000000.0, 0, 0, 0, KEY_THREE, MODEL_HAS_LINKS},
  {"links[%j].offset[%k]", "m", -10.0, 10.0, 0, 0, 1, KEY_THREE, MODEL_HAS_LINKS},
  {"tip[%k]", "m", -10.0, 10.0, 0, 0, 0, KEY_THREE, MODEL_HAS_LINKS},
  {"sensor_fault.hold_time", "s", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
  {"sensor_fault.force_resolution", "N", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
  {"sensor_fault.position_resolution", "m", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
  {"sensor_fault.jump_margin", "N", 0.0, 1000000000.0, 1, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
  {"sensor_fault.spring_margin", "N", 0.0, 1000000000.0, 1, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
  {"sensor_fault.longest_stand", "s", 0.0, 1000000000.0, 1, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
  {"sensor_fault.recovery_time", "s", 0.0, 1000000000.0, 0, 1, 1, KEY_ONE, MODEL_HAS_SENSOR_FAULT},
};

/* where the rows of each item begin, and after the last: a law has four, of which an asymmetric one has two each */
static const unsigned char first_row[ITEM_EXTENSION + 1] = {
0, 2, 6, 10, 11, 12, 13, 17, 18, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51, 52
};

const key_row* key_row_of(model_item_kind kind, uint32_t offset) {
  const uint32_t first = first_row[kind], count = first_row[kind + 1] - first;
  return &rows[first + offset % count];
}
