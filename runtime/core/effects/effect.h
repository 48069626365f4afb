/* A term beyond the paper: one file each, one row each in effect_table.c. It gives its value and its derivatives, says
 * which parameters it has and how much it remembers, and the finger does the rest. */
#ifndef TENDONFMU_EFFECT_H
#define TENDONFMU_EFFECT_H

#include <stddef.h>
#include <stdint.h>

enum { EFFECT_MAX_PARAMETERS = 8 };

typedef struct effect_parameter {
  const char* name;
  const char* unit;
  double minimum, maximum;
  int above_minimum;
  double missing_value; /* taken where the description leaves the key out */
  int required;         /* 1: it must not be left out */
} effect_parameter;

/* What an effect at a joint sees of one sample. */
typedef struct effect_sample {
  double joint_angle;    /* q_j, rad */
  double joint_velocity; /* rad/s */
  double rest_angle;     /* of the joint's cover, rad; 0 without one */
} effect_sample;

typedef struct effect_torque {
  double value;       /* N·m, added to T_j of eq. (10) */
  double by_angle;    /* N·m/rad */
  double by_velocity; /* N·m·s/rad */
  double by_parameter[EFFECT_MAX_PARAMETERS];
} effect_torque;

typedef struct effect_type {
  const char* name; /* as in contract section 7 */
  uint32_t id;      /* in the model image; never reused */
  uint32_t parameter_count;
  const effect_parameter* parameters;
  /* Numbers that the effect remembers, by its parameters: part of the finger's state block. */
  size_t (*state_count)(const double* parameters);
  /* Torque at its joint, with slopes; memory [state_count] as the sample before left it. */
  effect_torque (*torque)(const double* parameters, const effect_sample* sample, const double* memory);
  /* Brings the memory up to this sample, once it is accepted; NULL where there is none. */
  void (*remember)(const double* parameters, const effect_sample* sample, double* memory);
} effect_type;

/* Row by id or name; NULL when there is none. */
const effect_type* effect_by_id(uint32_t id);
const effect_type* effect_by_name(const char* name);

/* Row by position 0.., NULL past the end. */
const effect_type* effect_at(size_t position);

#endif
