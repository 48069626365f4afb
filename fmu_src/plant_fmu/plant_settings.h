/* The settings of a plant as numbers, one for each parameter of the variable table. */
#pragma once

#include <stddef.h>

#include "model.h"
#include "tendonfmu_plant.h"

/* Those of one number: name in the table's groups and here, field of the plant's settings, its type. */
#define SETTINGS(ENTRY)                                 \
  ENTRY(RELATIVE_TOLERANCE, relative_tolerance, double) \
  ENTRY(SCHEDULED_MOTION, scheduled_motion, int)        \
  ENTRY(SCHEDULED_PUSHES, scheduled_pushes, int)        \
  ENTRY(SENSORS, sensors, int)                          \
  ENTRY(SEED, seed, uint64_t)                           \
  ENTRY(PUSH_LINK, push_link, int)

#define PLACE_OF_SETTING(NAME, field, type) SETTING_##NAME,
enum { SETTINGS(PLACE_OF_SETTING) SETTING_PUSH_POINT, /* three */ SETTING_COUNT = SETTING_PUSH_POINT + 3 };

/* Place of an element of a parameter group. */
size_t setting_place(variable_group_id group, size_t index);

void settings_to_numbers(const tendonfmu_plant_settings* settings, double numbers[SETTING_COUNT]);
tendonfmu_plant_settings settings_from_numbers(const double numbers[SETTING_COUNT]);

/* The table's range; the last link of a finger is its last joint's. */
model_range setting_range(variable_group_id group, size_t joints);

/* 1 when all are in their ranges, and whole where they are counts or flags. */
int settings_are_sound(const double numbers[SETTING_COUNT], size_t joints);
