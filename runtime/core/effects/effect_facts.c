/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "floating_point.h"

#include "effect_facts.h"

static const effect_parameter numbers[] = {
  {.name = "stiffness", .unit = "N.m/rad3", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.05, .scale_everywhere = 0.0}, /* cover_hardening */
  {.name = "quadratic", .unit = "N.m/rad2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.02, .scale_everywhere = 0.0}, /* cover_hardening */
  {.name = "sine", .unit = "N.m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.005, .scale_everywhere = 0.0}, /* gravity */
  {.name = "cosine", .unit = "N.m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.005, .scale_everywhere = 0.0}, /* gravity */
  {.name = "inertia", .unit = "kg.m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 1e-05, .scale_everywhere = 0.0}, /* inertia */
  {.name = "sine", .unit = "kg.m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 1e-05, .scale_everywhere = 0.0}, /* inertia_variation */
  {.name = "cosine", .unit = "kg.m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 1e-05, .scale_everywhere = 0.0}, /* inertia_variation */
  {.name = "stiffness", .unit = "N.m/rad", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.02, .scale_everywhere = 0.0}, /* joint_coupling */
  {.name = "reaction", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -10.0, .maximum = 10.0, .above_minimum = 0, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0}, /* joint_coupling */
  {.name = "coulomb", .unit = "N", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.2, .scale_everywhere = 0.0}, /* preload_friction */
  {.name = "beyond", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -10.0, .maximum = 10.0, .above_minimum = 0, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0}, /* preload_friction */
  {.name = "coulomb", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0001, .scale_everywhere = 0.0}, /* load_friction */
  {.name = "correction", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 0.0, .required = 1, .scale = 0.05, .scale_everywhere = 0.0}, /* force_gain */
  {.name = "correction", .unit = "N", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.5, .scale_everywhere = 0.0}, /* force_offset */
  {.name = "correction", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0005, .scale_everywhere = 0.0}, /* moment_arm */
  {.name = "slope", .unit = "m/rad", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0005, .scale_everywhere = 0.0}, /* moment_arm_variation */
  {.name = "correction", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0005, .scale_everywhere = 0.0}, /* moment_arm_variation */
  {.name = "sine", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0005, .scale_everywhere = 0.0}, /* pulley_eccentricity */
  {.name = "cosine", .unit = "m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -1000000000.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0005, .scale_everywhere = 0.0}, /* pulley_eccentricity */
  {.name = "turns", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000.0, .above_minimum = 0, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0}, /* pulley_eccentricity */
  {.name = "displacement", .unit = "m", .unit_at_joint = "rad", .unit_everywhere = "s", .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 0.0001, .scale_everywhere = 0.05}, /* presliding */
  {.name = "stiffness", .unit = "N/m", .unit_at_joint = "N.m/rad", .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 10000.0, .scale_everywhere = 0.0}, /* presliding */
  {.name = "relaxation_time", .unit = "s", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0}, /* presliding */
  {.name = "share", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 1.0, .required = 0, .scale = 1.0, .scale_everywhere = 0.0}, /* presliding */
  {.name = "stiffness", .unit = "N/m", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 1.0, .maximum = 1000000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 100000.0, .scale_everywhere = 0.0}, /* cord_stretch */
  {.name = "amplitude", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -0.9, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.3, .scale_everywhere = 0.0}, /* friction_drift */
  {.name = "time_constant", .unit = "s", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 0.0, .required = 1, .scale = 100.0, .scale_everywhere = 0.0}, /* friction_drift */
  {.name = "hardening", .unit = "N/m2", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 100000.0, .scale_everywhere = 0.0}, /* tendon_nonlinearity */
  {.name = "width", .unit = "m", .unit_at_joint = "rad", .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.0001, .scale_everywhere = 0.0}, /* backlash */
  {.name = "delay", .unit = "s", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -0.05, .maximum = 0.05, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.002, .scale_everywhere = 0.0}, /* time_delay */
  {.name = "amplitude", .unit = "1", .unit_at_joint = NULL, .unit_everywhere = NULL, .minimum = -0.99, .maximum = 1000000000.0, .above_minimum = 0, .missing_value = 0.0, .required = 1, .scale = 0.3, .scale_everywhere = 0.0}, /* stribeck */
  {.name = "stribeck_velocity", .unit = "m/s", .unit_at_joint = "rad/s", .unit_everywhere = NULL, .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1, .missing_value = 0.0, .required = 1, .scale = 0.01, .scale_everywhere = 0.0}, /* stribeck */
};

static const effect_type all_effects[EFFECT_COUNT] = {
  {.name = "cover_hardening", .id = 1, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 0, .action = &cover_hardening_action},
  {.name = "gravity", .id = 2, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 2, .action = &gravity_action},
  {.name = "inertia", .id = 3, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = numbers + 4, .action = &inertia_action},
  {.name = "inertia_variation", .id = 12, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_NOT_LAST_JOINT, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 5, .action = &inertia_variation_action},
  {.name = "joint_coupling", .id = 4, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_NOT_LAST_JOINT, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 7, .action = &joint_coupling_action},
  {.name = "preload_friction", .id = 5, .joint = PLACE_OPTIONAL, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 9, .action = &preload_friction_action},
  {.name = "load_friction", .id = 6, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = numbers + 11, .action = &load_friction_action},
  {.name = "force_gain", .id = 7, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = numbers + 12, .action = &force_gain_action},
  {.name = "force_offset", .id = 8, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = numbers + 13, .action = &force_offset_action},
  {.name = "moment_arm", .id = 9, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = numbers + 14, .action = &moment_arm_action},
  {.name = "moment_arm_variation", .id = 10, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 15, .action = &moment_arm_variation_action},
  {.name = "pulley_eccentricity", .id = 11, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 3, .parameters = numbers + 17, .action = &pulley_eccentricity_action},
  {.name = "presliding", .id = 26, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_LEVEL_ALONE, .level = 1, .most = 2, .one_of = 2, .parameter_count = 4, .parameters = numbers + 20, .action = &presliding_action},
  {.name = "cord_stretch", .id = 27, .joint = PLACE_REFUSED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = numbers + 24, .action = &cord_stretch_action},
  {.name = "friction_drift", .id = 21, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_AT_MOST_ONE, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 25, .action = &friction_drift_action},
  {.name = "tendon_nonlinearity", .id = 22, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = numbers + 27, .action = &tendon_nonlinearity_action},
  {.name = "backlash", .id = 23, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_EXACTLY_ONE, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = numbers + 28, .action = &backlash_action},
  {.name = "time_delay", .id = 24, .joint = PLACE_REFUSED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = numbers + 29, .action = &time_delay_action},
  {.name = "stribeck", .id = 25, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_EXACTLY_ONE, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = numbers + 30, .action = &stribeck_action},
};

const effect_type* effect_at(size_t position) {
  return position < EFFECT_COUNT ? &all_effects[position] : NULL;
}

const effect_type* effect_by_id(uint32_t id) {
  for (size_t i = 0; i < EFFECT_COUNT; ++i) {
    if (all_effects[i].id == id) {
      return &all_effects[i];
    }
  }
  return NULL;
}
