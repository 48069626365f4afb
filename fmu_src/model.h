/* What an FMU simulates, as the rest of fmu_src sees it: the friction of a finger (finger_model.c), or the simulated
 * finger (plant_fmu/plant_model.c). Each library has one of them and one table of variables; all else is the same. */
#pragma once

#include <stddef.h>

#include "log.h"
#include "variable_table.h"

typedef struct model model;
struct variables;

typedef struct model_texts {
  const char* resource;       /* file in the folder resources that model_create() takes */
  const char* initialised;    /* what fmi2ExitInitializationMode logs */
  const char* waits;          /* the same where the first step has to initialise */
  int needs_inputs;           /* inputs that nobody has set are no reason to initialise */
  const char* no_derivatives; /* why there are none; NULL: there are */
} model_texts;
extern const model_texts model_text;

/* Of the bytes of the resource. `at_end`: the inputs of a step are those of its end. NULL when refused, with the
 * reason.
 */
model* model_create(const void* resource, size_t size, int at_end, log_text* reason);
void model_destroy(model* m); /* not NULL */

/* Back to what model_create() gave. */
void model_reset(model* m);

/* Identifier of the resource, of the table of variables and of `at_end`. */
void model_guid(const void* resource, size_t size, int at_end, char guid[39]);

/* What an instance of a resource never changes. */
typedef struct model_shape {
  size_t joints, tendons;
  size_t parameters;              /* by path, beyond the table's groups */
  size_t state_size;              /* bytes of a saved state, settings included */
  int has_links, watches_sensors; /* whether there are the groups of the table that need these */
} model_shape;
model_shape model_get_shape(const model* m);

/* One line about the last call that failed. */
const char* model_last_error(const model* m);

/* --- parameters --------------------------------------------------------------------------------------------------- */

typedef struct model_range {
  const char* unit;
  double minimum, maximum;
  int above_minimum; /* the minimum itself is refused */
  int tunable;       /* may be written between steps */
} model_range;

/* Parameters of the table's groups: Real, Integer and Boolean alike as numbers. They take effect at once, or with the
 * initialisation; written before it only. */
double model_get_setting(const model* m, variable_group_id group, size_t index);
void model_set_setting(model* m, variable_group_id group, size_t index, double value);
/* The table's range, or what this model leaves of it. */
model_range model_setting_range(const model* m, variable_group_id group);

/* Parameters by path, beyond the table's groups; they take effect with the next sample, all together. */
void model_get_parameters(const model* m, double* values);
model_range model_parameter_range(const model* m, size_t index);
/* 0, or -1 when the path is longer than size - 1. */
int model_parameter_path(const model* m, size_t index, char* path, size_t size);

/* The tolerance of fmi2SetupExperiment, replaced by the nearest that the model can use. NULL, or what was expected. */
const char* model_set_tolerance(model* m, double* tolerance);

/* --- life --------------------------------------------------------------------------------------------------------- */

/* All but MODEL_OK leave everything as it was, with the reason in model_last_error(). */
typedef enum model_answer {
  MODEL_OK,
  MODEL_BAD_INPUTS, /* it goes on with other inputs */
  MODEL_FAILED
} model_answer;

int model_is_initialised(const model* m);
model_answer model_initialise(model* m, struct variables* values, double start);

/* Before the initialisation, as if initialised with the present inputs; then back to before it. In between, outputs can
 * be fetched. */
model_answer model_begin_trial(model* m, struct variables* values, double start);
void model_end_trial(model* m);

/* Why there is no step from `time` over `step`; NULL when there is one. */
const char* model_refuse_step(const model* m, double time, double step);
/* Initialises first where model_initialise() found bad inputs or was not called. */
model_answer model_step(model* m, struct variables* values, double time, double step);

/* Time of the outputs. */
double model_get_time(const model* m);

/* Copies the outputs into the variables. */
void model_fetch_outputs(const model* m, struct variables* values);

/* Derivatives of the outputs, of the sample last taken, in the direction of the inputs: both in `view`, a layout of
 * variables. 0 or -1. */
int model_derive(const model* m, const struct variables* view);

/* --- saved states ------------------------------------------------------------------------------------------------- */

void model_save(const model* m, void* bytes);

/* Why these bytes cannot be a state; NULL when they can. Before the initialisation `may_be_initialised` is 0. Changes
 * nothing. */
const char* model_check_state(model* m, const void* bytes, int may_be_initialised);
int model_restore(model* m, const void* bytes);
