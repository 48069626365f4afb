/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "floating_point.h"

#include "effect_facts.h"

const effect_parameter cover_hardening_numbers[2] = {
  {.name = "stiffness", .unit = "N.m/rad3", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.05, .scale_everywhere = 0.0},
  {.name = "quadratic", .unit = "N.m/rad2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.02, .scale_everywhere = 0.0},
};

const effect_parameter gravity_numbers[2] = {
  {.name = "sine", .unit = "N.m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.005, .scale_everywhere = 0.0},
  {.name = "cosine", .unit = "N.m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.005, .scale_everywhere = 0.0},
};

const effect_parameter inertia_numbers[1] = {
  {.name = "inertia", .unit = "kg.m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 1e-05, .scale_everywhere = 0.0},
};

const effect_parameter inertia_variation_numbers[2] = {
  {.name = "sine", .unit = "kg.m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 1e-05, .scale_everywhere = 0.0},
  {.name = "cosine", .unit = "kg.m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 1e-05, .scale_everywhere = 0.0},
};

const effect_parameter joint_coupling_numbers[2] = {
  {.name = "stiffness", .unit = "N.m/rad", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.02, .scale_everywhere = 0.0},
  {.name = "reaction", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -10.0, .maximum = 10.0, .above_minimum = 0, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0},
};

const effect_parameter preload_friction_numbers[2] = {
  {.name = "coulomb", .unit = "N", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.2, .scale_everywhere = 0.0},
  {.name = "beyond", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -10.0, .maximum = 10.0, .above_minimum = 0, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0},
};

const effect_parameter load_friction_numbers[1] = {
  {.name = "coulomb", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0001, .scale_everywhere = 0.0},
};

const effect_parameter force_gain_numbers[1] = {
  {.name = "correction", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 0.0, .required = 1, .scale = 0.05, .scale_everywhere = 0.0},
};

const effect_parameter force_offset_numbers[1] = {
  {.name = "correction", .unit = "N", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.5, .scale_everywhere = 0.0},
};

const effect_parameter moment_arm_numbers[1] = {
  {.name = "correction", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0005, .scale_everywhere = 0.0},
};

const effect_parameter moment_arm_variation_numbers[1] = {
  {.name = "slope", .unit = "m/rad", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0005, .scale_everywhere = 0.0},
};

const effect_parameter pulley_eccentricity_numbers[3] = {
  {.name = "sine", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0005, .scale_everywhere = 0.0},
  {.name = "cosine", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0005, .scale_everywhere = 0.0},
  {.name = "turns", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000.0, .above_minimum = 0, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0},
};

const effect_parameter presliding_numbers[4] = {
  {.name = "displacement", .unit = "m", .unit_at_joint = "rad", .unit_everywhere = "s", .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0001, .scale_everywhere = 0.05},
  {.name = "stiffness", .unit = "N/m", .unit_at_joint = "N.m/rad", .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 10000.0, .scale_everywhere = 0.0},
  {.name = "relaxation_time", .unit = "s", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0},
  {.name = "share", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0},
};

const effect_parameter cord_stretch_numbers[1] = {
  {.name = "stiffness", .unit = "N/m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 1.0, .maximum = 1000000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 100000.0, .scale_everywhere = 0.0},
};

const effect_parameter friction_drift_numbers[2] = {
  {.name = "amplitude", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -0.9, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.3, .scale_everywhere = 0.0},
  {.name = "time_constant", .unit = "s", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 0.0, .required = 1, .scale = 100.0, .scale_everywhere = 0.0},
};

const effect_parameter tendon_nonlinearity_numbers[1] = {
  {.name = "hardening", .unit = "N/m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 100000.0, .scale_everywhere = 0.0},
};

const effect_parameter backlash_numbers[1] = {
  {.name = "width", .unit = "m", .unit_at_joint = "rad", .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0001, .scale_everywhere = 0.0},
};

const effect_parameter time_delay_numbers[1] = {
  {.name = "delay", .unit = "s", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -0.05, .maximum = 0.05, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.002, .scale_everywhere = 0.0},
};

const effect_parameter stribeck_numbers[2] = {
  {.name = "amplitude", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -0.99, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.3, .scale_everywhere = 0.0},
  {.name = "stribeck_velocity", .unit = "m/s", .unit_at_joint = "rad/s", .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 0.0, .required = 1, .scale = 0.01, .scale_everywhere = 0.0},
};

const effect_type* const all_effects[EFFECT_COUNT] = {
  &effect_cover_hardening,
  &effect_gravity,
  &effect_inertia,
  &effect_inertia_variation,
  &effect_joint_coupling,
  &effect_preload_friction,
  &effect_load_friction,
  &effect_force_gain,
  &effect_force_offset,
  &effect_moment_arm,
  &effect_moment_arm_variation,
  &effect_pulley_eccentricity,
  &effect_presliding,
  &effect_cord_stretch,
  &effect_friction_drift,
  &effect_tendon_nonlinearity,
  &effect_backlash,
  &effect_time_delay,
  &effect_stribeck,
};

const effect_type* effect_at(size_t position) {
  return position < EFFECT_COUNT ? all_effects[position] : NULL;
}

const effect_type* effect_by_id(uint32_t id) {
  for (size_t i = 0; effect_at(i); ++i) {
    if (all_effects[i]->id == id) {
      return all_effects[i];
    }
  }
  return NULL;
}
