/* The model of the simulated finger: a plant of tendonfmu_plant.h. The plant's time is 0 at the FMU's start time. */
#pragma once

#include "model.h"
#include "plant_settings.h"
#include "tendonfmu_plant.h"

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
