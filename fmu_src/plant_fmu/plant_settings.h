/* The settings of a plant as numbers, one for each parameter of the variable table. */
#pragma once

#include <stddef.h>

#include "model.h"
#include "tendonfmu_plant.h"

enum {
  SETTING_INTEGRATOR,
  SETTING_RELATIVE_TOLERANCE,
  SETTING_STEP,
  SETTING_SCHEDULED_MOTION,
  SETTING_SCHEDULED_PUSHES,
  SETTING_SENSORS,
  SETTING_SEED,
  SETTING_PUSH_LINK,
  SETTING_PUSH_POINT, /* three */
  SETTING_COUNT = SETTING_PUSH_POINT + 3
};

/* Place of an element of a parameter group. */
size_t setting_place(variable_group_id group, size_t index);

void settings_to_numbers(const tendonfmu_plant_settings* settings, double numbers[SETTING_COUNT]);
tendonfmu_plant_settings settings_from_numbers(const double numbers[SETTING_COUNT]);

/* The table's range; the last link of a finger is its last joint's. */
model_range setting_range(variable_group_id group, size_t joints);

/* 1 when all are in their ranges, and whole where they are counts or flags. */
int settings_are_sound(const double numbers[SETTING_COUNT], size_t joints);
