/* Generated from the tables in runtime/description by `python tools/tables/generate.py`: do not edit. */
/* clang-format off */
#pragma once

#include "effect.h"

extern const effect_action cover_hardening_action;
extern const effect_action gravity_action;
extern const effect_action inertia_action;
extern const effect_action inertia_variation_action;
extern const effect_action joint_coupling_action;
extern const effect_action preload_friction_action;
extern const effect_action load_friction_action;
extern const effect_action force_gain_action;
extern const effect_action force_offset_action;
extern const effect_action moment_arm_action;
extern const effect_action moment_arm_variation_action;
extern const effect_action pulley_eccentricity_action;
extern const effect_action presliding_action;
extern const effect_action cord_stretch_action;
extern const effect_action friction_drift_action;
extern const effect_action tendon_nonlinearity_action;
extern const effect_action backlash_action;
extern const effect_action time_delay_action;
extern const effect_action stribeck_action;

enum { EFFECT_COUNT = 19 };

enum { PRESLIDING_IS_LINKED = EFFECT_IS_LINKED(26) };
