/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#pragma once

#include "effect.h"

/* Name, number in the image, places and numbers of each effect: the first line of its effect_type. */
#define COVER_HARDENING_FACTS .name = "cover_hardening", .id = 1, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = cover_hardening_numbers
#define GRAVITY_FACTS .name = "gravity", .id = 2, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = gravity_numbers
#define INERTIA_FACTS .name = "inertia", .id = 3, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = inertia_numbers
#define INERTIA_VARIATION_FACTS .name = "inertia_variation", .id = 12, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_NOT_LAST_JOINT, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = inertia_variation_numbers
#define JOINT_COUPLING_FACTS .name = "joint_coupling", .id = 4, .joint = PLACE_REQUIRED, .tendon = PLACE_REFUSED, .rule = PLACES_NOT_LAST_JOINT, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = joint_coupling_numbers
#define PRELOAD_FRICTION_FACTS .name = "preload_friction", .id = 5, .joint = PLACE_OPTIONAL, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = preload_friction_numbers
#define LOAD_FRICTION_FACTS .name = "load_friction", .id = 6, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = load_friction_numbers
#define FORCE_GAIN_FACTS .name = "force_gain", .id = 7, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = force_gain_numbers
#define FORCE_OFFSET_FACTS .name = "force_offset", .id = 8, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = force_offset_numbers
#define MOMENT_ARM_FACTS .name = "moment_arm", .id = 9, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = moment_arm_numbers
#define MOMENT_ARM_VARIATION_FACTS .name = "moment_arm_variation", .id = 10, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 1, .parameters = moment_arm_variation_numbers
#define PULLEY_ECCENTRICITY_FACTS .name = "pulley_eccentricity", .id = 11, .joint = PLACE_REQUIRED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 0, .one_of = 0, .parameter_count = 3, .parameters = pulley_eccentricity_numbers
#define PRESLIDING_FACTS .name = "presliding", .id = 26, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_LEVEL_ALONE, .level = 1, .most = 2, .one_of = 2, .parameter_count = 4, .parameters = presliding_numbers
#define CORD_STRETCH_FACTS .name = "cord_stretch", .id = 27, .joint = PLACE_REFUSED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = cord_stretch_numbers
#define FRICTION_DRIFT_FACTS .name = "friction_drift", .id = 21, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_AT_MOST_ONE, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = friction_drift_numbers
#define TENDON_NONLINEARITY_FACTS .name = "tendon_nonlinearity", .id = 22, .joint = PLACE_REFUSED, .tendon = PLACE_REQUIRED, .rule = PLACES_AS_SAID, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = tendon_nonlinearity_numbers
#define BACKLASH_FACTS .name = "backlash", .id = 23, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_EXACTLY_ONE, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = backlash_numbers
#define TIME_DELAY_FACTS .name = "time_delay", .id = 24, .joint = PLACE_REFUSED, .tendon = PLACE_REFUSED, .rule = PLACES_AS_SAID, .level = 0, .most = 1, .one_of = 0, .parameter_count = 1, .parameters = time_delay_numbers
#define STRIBECK_FACTS .name = "stribeck", .id = 25, .joint = PLACE_OPTIONAL, .tendon = PLACE_OPTIONAL, .rule = PLACES_EXACTLY_ONE, .level = 0, .most = 0, .one_of = 0, .parameter_count = 2, .parameters = stribeck_numbers

extern const effect_parameter cover_hardening_numbers[2];
extern const effect_parameter gravity_numbers[2];
extern const effect_parameter inertia_numbers[1];
extern const effect_parameter inertia_variation_numbers[2];
extern const effect_parameter joint_coupling_numbers[2];
extern const effect_parameter preload_friction_numbers[2];
extern const effect_parameter load_friction_numbers[1];
extern const effect_parameter force_gain_numbers[1];
extern const effect_parameter force_offset_numbers[1];
extern const effect_parameter moment_arm_numbers[1];
extern const effect_parameter moment_arm_variation_numbers[1];
extern const effect_parameter pulley_eccentricity_numbers[3];
extern const effect_parameter presliding_numbers[4];
extern const effect_parameter cord_stretch_numbers[1];
extern const effect_parameter friction_drift_numbers[2];
extern const effect_parameter tendon_nonlinearity_numbers[1];
extern const effect_parameter backlash_numbers[1];
extern const effect_parameter time_delay_numbers[1];
extern const effect_parameter stribeck_numbers[2];

extern const effect_type effect_cover_hardening;
extern const effect_type effect_gravity;
extern const effect_type effect_inertia;
extern const effect_type effect_inertia_variation;
extern const effect_type effect_joint_coupling;
extern const effect_type effect_preload_friction;
extern const effect_type effect_load_friction;
extern const effect_type effect_force_gain;
extern const effect_type effect_force_offset;
extern const effect_type effect_moment_arm;
extern const effect_type effect_moment_arm_variation;
extern const effect_type effect_pulley_eccentricity;
extern const effect_type effect_presliding;
extern const effect_type effect_cord_stretch;
extern const effect_type effect_friction_drift;
extern const effect_type effect_tendon_nonlinearity;
extern const effect_type effect_backlash;
extern const effect_type effect_time_delay;
extern const effect_type effect_stribeck;

enum { EFFECT_COUNT = 19 };

/* All effects, in the order of the table. */
extern const effect_type* const all_effects[EFFECT_COUNT];
