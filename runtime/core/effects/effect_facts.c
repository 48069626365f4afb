/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#include "floating_point.h"

#include "effect_facts.h"

#include <math.h>

static const effect_parameter cover_hardening_numbers[] = {{.name = "stiffness", .unit = "N.m/rad3", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "quadratic", .unit = "N.m/rad2", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter gravity_numbers[] = {{.name = "sine", .unit = "N.m", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "cosine", .unit = "N.m", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter inertia_numbers[] = {{.name = "inertia", .unit = "kg.m2", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter inertia_variation_numbers[] = {{.name = "sine", .unit = "kg.m2", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "cosine", .unit = "kg.m2", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter joint_coupling_numbers[] = {{.name = "stiffness", .unit = "N.m/rad", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "reaction", .unit = "1", .minimum = -10.0, .maximum = 10.0}};
static const effect_parameter preload_friction_numbers[] = {{.name = "coulomb", .unit = "N", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "beyond", .unit = "1", .minimum = -10.0, .maximum = 10.0}};
static const effect_parameter load_friction_numbers[] = {{.name = "coulomb", .unit = "m", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter force_gain_numbers[] = {{.name = "correction", .unit = "1", .minimum = -1.0, .maximum = 1000000000.0, .above_minimum = 1}};
static const effect_parameter force_offset_numbers[] = {{.name = "correction", .unit = "N", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter moment_arm_numbers[] = {{.name = "correction", .unit = "m", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter moment_arm_variation_numbers[] = {{.name = "slope", .unit = "m/rad", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "correction", .unit = "m", .minimum = -1000000000.0, .maximum = 1000000000.0}};
static const effect_parameter pulley_eccentricity_numbers[] = {{.name = "sine", .unit = "m", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "cosine", .unit = "m", .minimum = -1000000000.0, .maximum = 1000000000.0}, {.name = "turns", .unit = "1", .minimum = 0.0, .maximum = 1000.0}};
static const effect_parameter presliding_numbers[] = {{.name = "displacement", .unit = "m", .unit_at_joint = "rad", .unit_everywhere = "s", .minimum = 0.0, .maximum = 1000000000.0}, {.name = "stiffness", .unit = "N/m", .unit_at_joint = "N.m/rad", .minimum = 0.0, .maximum = 1000000000000.0}, {.name = "relaxation_time", .unit = "s", .minimum = 0.0, .maximum = 1000000000.0}, {.name = "share", .unit = "1", .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1}, {.name = "follows_limit", .unit = "1", .minimum = 0.0, .maximum = 1.0}, {.name = "filtered_travel", .unit = "1", .minimum = 0.0, .maximum = 1.0}};
static const effect_parameter cord_stretch_numbers[] = {{.name = "stiffness", .unit = "N/m", .minimum = 1.0, .maximum = 1000000000000.0}};
static const effect_parameter friction_drift_numbers[] = {{.name = "amplitude", .unit = "1", .minimum = -0.9, .maximum = 1000000000.0}, {.name = "time_constant", .unit = "s", .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1}};
static const effect_parameter tendon_nonlinearity_numbers[] = {{.name = "hardening", .unit = "N/m2", .minimum = 0.0, .maximum = 1000000000000.0}};
static const effect_parameter backlash_numbers[] = {{.name = "width", .unit = "m", .unit_at_joint = "rad", .minimum = 0.0, .maximum = 1000000000.0}};
static const effect_parameter time_delay_numbers[] = {{.name = "delay", .unit = "s", .minimum = -0.05, .maximum = 0.05}};
static const effect_parameter stribeck_numbers[] = {{.name = "amplitude", .unit = "1", .minimum = -0.99, .maximum = 1000000000.0}, {.name = "stribeck_velocity", .unit = "m/s", .unit_at_joint = "rad/s", .minimum = 0.0, .maximum = 1000000000.0, .above_minimum = 1}};

#define LINKED(id, what) (EFFECT_IS_LINKED(id) ? (what) : 0)

static const effect_type all_effects[EFFECT_COUNT] = {
  {.name = "cover_hardening", .id = 1, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(1, 2), .parameters = LINKED(1, cover_hardening_numbers), .action = LINKED(1, &cover_hardening_action)},
  {.name = "gravity", .id = 2, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(2, 2), .parameters = LINKED(2, gravity_numbers), .action = LINKED(2, &gravity_action)},
  {.name = "inertia", .id = 3, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(3, 1), .parameters = LINKED(3, inertia_numbers), .action = LINKED(3, &inertia_action)},
  {.name = "inertia_variation", .id = 12, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_NOT_LAST_JOINT, .parameter_count = LINKED(12, 2), .parameters = LINKED(12, inertia_variation_numbers), .action = LINKED(12, &inertia_variation_action)},
  {.name = "joint_coupling", .id = 4, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_NOT_LAST_JOINT, .parameter_count = LINKED(4, 2), .parameters = LINKED(4, joint_coupling_numbers), .action = LINKED(4, &joint_coupling_action)},
  {.name = "preload_friction", .id = 5, .joint = PLACE_OPTIONAL, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(5, 2), .parameters = LINKED(5, preload_friction_numbers), .action = LINKED(5, &preload_friction_action)},
  {.name = "load_friction", .id = 6, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(6, 1), .parameters = LINKED(6, load_friction_numbers), .action = LINKED(6, &load_friction_action)},
  {.name = "force_gain", .id = 7, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(7, 1), .parameters = LINKED(7, force_gain_numbers), .action = LINKED(7, &force_gain_action)},
  {.name = "force_offset", .id = 8, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(8, 1), .parameters = LINKED(8, force_offset_numbers), .action = LINKED(8, &force_offset_action)},
  {.name = "moment_arm", .id = 9, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(9, 1), .parameters = LINKED(9, moment_arm_numbers), .action = LINKED(9, &moment_arm_action)},
  {.name = "moment_arm_variation", .id = 10, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(10, 2), .parameters = LINKED(10, moment_arm_variation_numbers), .action = LINKED(10, &moment_arm_variation_action)},
  {.name = "pulley_eccentricity", .id = 11, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .parameter_count = LINKED(11, 3), .parameters = LINKED(11, pulley_eccentricity_numbers), .action = LINKED(11, &pulley_eccentricity_action)},
  {.name = "presliding", .id = 26, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_LEVEL_ALONE, .level = 1, .most = 2, .one_of = 2, .parameter_count = LINKED(26, 6), .parameters = LINKED(26, presliding_numbers), .action = LINKED(26, &presliding_action)},
  {.name = "cord_stretch", .id = 27, .joint = PLACE_REFUSED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .most = 1, .parameter_count = LINKED(27, 1), .parameters = LINKED(27, cord_stretch_numbers), .action = LINKED(27, &cord_stretch_action)},
  {.name = "friction_drift", .id = 21, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_AT_MOST_ONE, .parameter_count = LINKED(21, 2), .parameters = LINKED(21, friction_drift_numbers), .action = LINKED(21, &friction_drift_action)},
  {.name = "tendon_nonlinearity", .id = 22, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .most = 1, .parameter_count = LINKED(22, 1), .parameters = LINKED(22, tendon_nonlinearity_numbers), .action = LINKED(22, &tendon_nonlinearity_action)},
  {.name = "backlash", .id = 23, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_EXACTLY_ONE, .most = 1, .parameter_count = LINKED(23, 1), .parameters = LINKED(23, backlash_numbers), .action = LINKED(23, &backlash_action)},
  {.name = "time_delay", .id = 24, .joint = PLACE_REFUSED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .most = 1, .parameter_count = LINKED(24, 1), .parameters = LINKED(24, time_delay_numbers), .action = LINKED(24, &time_delay_action)},
  {.name = "stribeck", .id = 25, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_EXACTLY_ONE, .parameter_count = LINKED(25, 2), .parameters = LINKED(25, stribeck_numbers), .action = LINKED(25, &stribeck_action)},
};

static const effect_expectation expectations[EFFECT_COUNT][EFFECT_MAX_PARAMETERS] = {
  {{NAN, 0.05, 0.0}, {0.0, 0.02, 0.0}}, /* cover_hardening */
  {{0.0, 0.005, 0.0}, {0.0, 0.005, 0.0}}, /* gravity */
  {{NAN, 1e-05, 0.0}}, /* inertia */
  {{0.0, 1e-05, 0.0}, {0.0, 1e-05, 0.0}}, /* inertia_variation */
  {{NAN, 0.02, 0.0}, {1.0, 1.0, 0.0}}, /* joint_coupling */
  {{NAN, 0.2, 0.0}, {1.0, 1.0, 0.0}}, /* preload_friction */
  {{NAN, 0.0001, 0.0}}, /* load_friction */
  {{NAN, 0.05, 0.0}}, /* force_gain */
  {{NAN, 0.5, 0.0}}, /* force_offset */
  {{NAN, 0.0005, 0.0}}, /* moment_arm */
  {{NAN, 0.0005, 0.0}, {0.0, 0.0005, 0.0}}, /* moment_arm_variation */
  {{0.0, 0.0005, 0.0}, {0.0, 0.0005, 0.0}, {1.0, 1.0, 0.0}}, /* pulley_eccentricity */
  {{0.0, 0.0001, 0.05}, {0.0, 10000.0, 0.0}, {0.0, 1.0, 0.0}, {1.0, 1.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}, /* presliding */
  {{NAN, 100000.0, 0.0}}, /* cord_stretch */
  {{NAN, 0.3, 0.0}, {NAN, 100.0, 0.0}}, /* friction_drift */
  {{NAN, 100000.0, 0.0}}, /* tendon_nonlinearity */
  {{NAN, 0.0001, 0.0}}, /* backlash */
  {{NAN, 0.002, 0.0}}, /* time_delay */
  {{NAN, 0.3, 0.0}, {NAN, 0.01, 0.0}}, /* stribeck */
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

const effect_expectation* effect_expectation_of(const effect_type* effect, uint32_t offset) {
  return &expectations[effect - all_effects][offset];
}
