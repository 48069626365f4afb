#include <string.h>

#include "backlash.h"
#include "cover_hardening.h"
#include "effect.h"
#include "force_gain.h"
#include "force_offset.h"
#include "friction_drift.h"
#include "gravity.h"
#include "inertia.h"
#include "joint_coupling.h"
#include "load_friction.h"
#include "moment_arm.h"
#include "moment_arm_variation.h"
#include "preload_friction.h"
#include "presliding.h"
#include "pulley_eccentricity.h"
#include "stribeck.h"
#include "tendon_nonlinearity.h"
#include "time_delay.h"

static const effect_type* const table[] = {
    &effect_cover_hardening,
    &effect_gravity,
    &effect_inertia,
    &effect_joint_coupling,
    &effect_preload_friction,
    &effect_load_friction,
    &effect_force_gain,
    &effect_force_offset,
    &effect_moment_arm,
    &effect_moment_arm_variation,
    &effect_pulley_eccentricity,
    &effect_presliding,
    &effect_friction_drift,
    &effect_tendon_nonlinearity,
    &effect_backlash,
    &effect_time_delay,
    &effect_stribeck,
};

const effect_type* effect_at(size_t position) {
  return position < sizeof table / sizeof table[0] ? table[position] : NULL;
}

const effect_type* effect_by_id(uint32_t id) {
  for (size_t i = 0; effect_at(i); ++i) {
    if (table[i]->id == id) {
      return table[i];
    }
  }
  return NULL;
}

const effect_type* effect_by_name(const char* name) {
  for (size_t i = 0; effect_at(i); ++i) {
    if (strcmp(table[i]->name, name) == 0) {
      return table[i];
    }
  }
  return NULL;
}
