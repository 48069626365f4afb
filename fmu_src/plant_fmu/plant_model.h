/* The model of the simulated finger: a plant of tendonfmu_plant.h. The plant's time is 0 at the FMU's start time. */
#pragma once

#include "model.h"
#include "tendonfmu_plant.h"

/* --- the settings of a plant as numbers, one for each parameter of the variable table ----------------------------- */

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

/* --- the model ---------------------------------------------------------------------------------------------------- */

enum { PLANT_ERROR_BYTES = 480 };

struct model {
  tendonfmu_plant* plant;
  size_t joints, tendons, input_count, plant_state_size;
  double given[SETTING_COUNT];  /* of the rig */
  double wanted[SETTING_COUNT]; /* as written: taken with the initialisation */
  double used[SETTING_COUNT];   /* that the plant is initialised with, where it is */
  double* inputs;               /* [input_count] that the plant has */
  double* before;               /* [input_count] that it had, to go back to */
  unsigned char* scratch;       /* [plant_state_size] */
  double start;                 /* s, time of the FMU where that of the plant is 0 */
  int running;                  /* initialised for good, not only to look at outputs */
  int commanded;         /* a command that is not all 0 has come; until then the motors hold their first position */
  int tolerance_written; /* relative_tolerance was written: it stands above that of fmi2SetupExperiment */
  char error[PLANT_ERROR_BYTES];
};

/* Keeps the plant's words about the call that failed, since the next call may replace them. Returns -1. */
int plant_failed(model* m);

/* A plant before its initialisation, with these settings [SETTING_COUNT]. 0 or -1. */
int plant_start_over(model* m, const double* settings);

/* Bytes of a saved state of the FMU's model. */
size_t plant_model_state_size(const model* m);

/* Hands over inputs [input_count] within their ranges. 0 or -1. */
int plant_take_inputs(model* m, const double* inputs);
