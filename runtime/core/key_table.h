/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#pragma once

#include <stdint.h>

enum {
  MODEL_MAX_JOINTS = 16,
  MODEL_MAX_TENDONS = 64,
  MODEL_MAX_POINTS = 256,
  MODEL_MAX_BANDS = 4,
  MODEL_MAX_EXTENSIONS = 1024
};

/* The option bits of the model image: which parts of a description are there. The bits of keys stand in
 * description/keys.json by their names. */
enum {
  MODEL_HAS_INITIAL_VARIANCE = 1,
  MODEL_HAS_INITIAL_TORQUE = 2,
  MODEL_HAS_NOISE_TIME = 4,
  MODEL_HAS_SENSOR_FAULT = 8,
  MODEL_FORGETS_BY_ABSORPTION = 16,
  MODEL_DETECTS_BY_BANDS = 32,
  MODEL_WATCHES_MOTORS = 64, /* beside the bit before */
  MODEL_HAS_DEVIATION = 128,
  MODEL_HAS_LINKS = 256,
  MODEL_HAS_TENDON_ZERO = 512, /* of any tendon; then every one has it */
  MODEL_OPTION_BITS = 1023
};

/* Those whose code is linked: all, unless a program's build says which its fingers have. */
#ifndef TENDONFMU_OPTIONS
#define TENDONFMU_OPTIONS MODEL_OPTION_BITS
#endif

/* The parameters come in items, in this order: joints, tendons, finger, extensions. */
typedef enum model_item_kind {
  ITEM_COVER, /* joints[j].cover */
  ITEM_JOINT_FRICTION, /* joints[j].friction */
  ITEM_LOAD_FRICTION, /* joints[j].load_friction */
  ITEM_STIFFNESS, /* tendons[i].stiffness */
  ITEM_MOMENT_ARMS, /* tendons[i].moment_arms[j] */
  ITEM_TENDON_ZERO, /* tendons[i].zero */
  ITEM_PULLEY_FRICTION, /* tendons[i].pulley_friction[j] */
  ITEM_EDGE_ANGLES, /* tendons[i].edge_friction[j].angles[k] */
  ITEM_EDGE_FRICTION, /* tendons[i].edge_friction[j] */
  ITEM_TENDON_THRESHOLD, /* velocity_threshold.tendon */
  ITEM_JOINT_THRESHOLD, /* velocity_threshold.joint */
  ITEM_FILTER_CUTOFF, /* velocity_filter_cutoff */
  ITEM_DRIFT_VARIANCE, /* bias.drift_variance */
  ITEM_NOISE_STD, /* bias.noise_std */
  ITEM_NOISE_STD_PER_FORCE, /* bias.noise_std_per_force */
  ITEM_INITIAL_VARIANCE, /* bias.initial_variance */
  ITEM_FORGET_RATE, /* bias.forget_rate */
  ITEM_INITIAL_TORQUE, /* bias.initial_torque[j] */
  ITEM_NOISE_TIME, /* bias.noise_time */
  ITEM_CONTACT_THRESHOLD, /* contact.threshold[j] */
  ITEM_CONTACT_PER_FORCE, /* contact.threshold_per_force[j] */
  ITEM_BAND_NOISE, /* contact.bands[d].noise[j] */
  ITEM_BAND_FRICTION, /* contact.bands[d].friction[j] */
  ITEM_BAND_FRICTION_LIMIT, /* contact.bands[d].friction_limit[j] */
  ITEM_BAND_MOTOR_LOAD, /* contact.bands[d].motor_load[j] */
  ITEM_BAND_FRICTION_CHANGE, /* contact.bands[d].friction_change[j] */
  ITEM_BAND_FRICTION_RESERVE, /* contact.bands[d].friction_reserve[j] */
  ITEM_DEVIATION, /* contact.deviation[j] */
  ITEM_DEVIATION_PER_FORCE, /* contact.deviation_per_force[j] */
  ITEM_LINK_AXIS, /* links[j].axis[c] */
  ITEM_LINK_OFFSET, /* links[j].offset[c] */
  ITEM_TIP, /* tip[c] */
  ITEM_FAULT_HOLD_TIME, /* sensor_fault.hold_time */
  ITEM_FAULT_FORCE_RESOLUTION, /* sensor_fault.force_resolution */
  ITEM_FAULT_POSITION_RESOLUTION, /* sensor_fault.position_resolution */
  ITEM_FAULT_JUMP_MARGIN, /* sensor_fault.jump_margin */
  ITEM_FAULT_SPRING_MARGIN, /* sensor_fault.spring_margin */
  ITEM_FAULT_LONGEST_STAND, /* sensor_fault.longest_stand */
  ITEM_FAULT_RECOVERY_TIME, /* sensor_fault.recovery_time */
  ITEM_EXTENSION /* as many as the effect has */
} model_item_kind;

/* Numbers of an item whose shape is in no shape word. */
typedef enum key_count { KEY_ONE, KEY_PER_JOINT, KEY_THREE } key_count;

/* A number of the finger description. In its path %i is the tendon, %j the joint, %d the band and %k the number
 * within its item, all from 1; %@ is .laws[…] where an edge has working points, %~ the side of an asymmetric law. */
typedef struct key_row {
  const char* path;
  const char* unit; /* FMI notation */
  double minimum, maximum;
  unsigned char above_minimum; /* the minimum itself is not allowed */
  unsigned char tunable, has_default;
  unsigned char count; /* key_count */
  uint16_t option; /* the bit of the model image without which it is not there; 0: always there */
} key_row;

/* The row of number `offset` of an item; not of ITEM_EXTENSION. */
const key_row* key_row_of(model_item_kind kind, uint32_t offset);
