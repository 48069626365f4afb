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

static const double default_values[sizeof rows / sizeof rows[0]] = {
  [22] = 0.0005, /* velocity_threshold.tendon */
  [23] = 0.01, /* velocity_threshold.joint */
  [24] = 20.0, /* velocity_filter_cutoff */
  [25] = 1e-06, /* bias.drift_variance */
  [26] = 0.01, /* bias.noise_std */
  [29] = 5.0, /* bias.forget_rate */
  [45] = 0.05, /* sensor_fault.hold_time */
  [46] = 0.01, /* sensor_fault.force_resolution */
  [47] = 2e-06, /* sensor_fault.position_resolution */
  [48] = 1.0, /* sensor_fault.jump_margin */
  [49] = 1.0, /* sensor_fault.spring_margin */
  [50] = 1000000000.0, /* sensor_fault.longest_stand */
  [51] = 0.5, /* sensor_fault.recovery_time */
};

/* where the rows of an item begin, and how many there are: a law has four, of which an asymmetric one has two each */
static const struct { unsigned char first, count; } items[ITEM_EXTENSION] = {
  [ITEM_COVER] = {0, 2},
  [ITEM_JOINT_FRICTION] = {2, 4},
  [ITEM_LOAD_FRICTION] = {6, 4},
  [ITEM_STIFFNESS] = {10, 1},
  [ITEM_MOMENT_ARMS] = {11, 1},
  [ITEM_TENDON_ZERO] = {12, 1},
  [ITEM_PULLEY_FRICTION] = {13, 4},
  [ITEM_EDGE_ANGLES] = {17, 1},
  [ITEM_EDGE_FRICTION] = {18, 4},
  [ITEM_TENDON_THRESHOLD] = {22, 1},
  [ITEM_JOINT_THRESHOLD] = {23, 1},
  [ITEM_FILTER_CUTOFF] = {24, 1},
  [ITEM_DRIFT_VARIANCE] = {25, 1},
  [ITEM_NOISE_STD] = {26, 1},
  [ITEM_NOISE_STD_PER_FORCE] = {27, 1},
  [ITEM_INITIAL_VARIANCE] = {28, 1},
  [ITEM_FORGET_RATE] = {29, 1},
  [ITEM_INITIAL_TORQUE] = {30, 1},
  [ITEM_NOISE_TIME] = {31, 1},
  [ITEM_CONTACT_THRESHOLD] = {32, 1},
  [ITEM_CONTACT_PER_FORCE] = {33, 1},
  [ITEM_BAND_NOISE] = {34, 1},
  [ITEM_BAND_FRICTION] = {35, 1},
  [ITEM_BAND_FRICTION_LIMIT] = {36, 1},
  [ITEM_BAND_MOTOR_LOAD] = {37, 1},
  [ITEM_BAND_FRICTION_CHANGE] = {38, 1},
  [ITEM_BAND_FRICTION_RESERVE] = {39, 1},
  [ITEM_DEVIATION] = {40, 1},
  [ITEM_DEVIATION_PER_FORCE] = {41, 1},
  [ITEM_LINK_AXIS] = {42, 1},
  [ITEM_LINK_OFFSET] = {43, 1},
  [ITEM_TIP] = {44, 1},
  [ITEM_FAULT_HOLD_TIME] = {45, 1},
  [ITEM_FAULT_FORCE_RESOLUTION] = {46, 1},
  [ITEM_FAULT_POSITION_RESOLUTION] = {47, 1},
  [ITEM_FAULT_JUMP_MARGIN] = {48, 1},
  [ITEM_FAULT_SPRING_MARGIN] = {49, 1},
  [ITEM_FAULT_LONGEST_STAND] = {50, 1},
  [ITEM_FAULT_RECOVERY_TIME] = {51, 1},
};

const key_row* key_row_of(model_item_kind kind, uint32_t offset) {
  return &rows[items[kind].first + offset % items[kind].count];
}

double key_default(const key_row* row) {
  return default_values[row - rows];
}
