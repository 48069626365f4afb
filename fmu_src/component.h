/* One instance of the FMU: a model, its variables, and where it stands in the life that FMI prescribes. */
#pragma once

#include <stdint.h>

#include "call_table.h"
#include "log.h"
#include "model.h"
#include "variables.h"

/* Where the variables of a call live. An importer reads and writes the same ones step after step, which are found once.
 */
enum { PLACES_MOST = 256 }; /* of one round: a call with more takes some */
typedef struct variable_places {
  size_t references, elements;
  int inputs, outputs, parameters; /* whether some are */
  int apart;                       /* they do not stand one after another */
  unsigned of[PLACES_MOST];        /* [references] value references */
  unsigned place[PLACES_MOST];     /* [elements] variables_place() */
} variable_places;

typedef struct component {
  log_target log;
  char* instance_name;
  struct model* model; /* `struct` for C++, where the member hides the type */
  variables values;
  uint64_t identity; /* of the FMU, in its saved states */

  fmu_phase phase;
  int failed;          /* an error was returned: state "error" on top of the phase */
  int waiting;         /* for the first sample: until then outputs follow the inputs */
  int inputs_given;    /* an input was set: there is something to initialise with */
  int outputs_pending; /* while waiting: outputs do not belong to the present inputs */
  int stop_time_defined;
  double start_time, stop_time;

  fmu_status step_status; /* of the last step: OK or discarded */
  unsigned refusals;      /* how often in a row the step at refused_at was discarded */
  double refused_at;      /* s */

  variable_places read[VARIABLE_STRING], written[VARIABLE_STRING]; /* last, by variable_type */
} component;

void component_destroy(component* c);

/* There was no discarded step. */
void component_forget_steps(component* c);

/* Logs that the function may not be called now, and fails. Returns 0. */
int component_refuse_call(component* c, fmu_function function);

/* 1 when the function may be called now; otherwise logs and fails. c may be NULL: 0. */
static inline int component_may_call(component* c, fmu_function function) {
  return c && (call_is_allowed(function, c->failed ? PHASE_ERROR : c->phase) || component_refuse_call(c, function));
}

/* Logs "<function>: <line>" as an error, enters the state "error" and returns FMU_ERROR. */
fmu_status component_fail(component* c, const char* function, const char* format, ...) MESSAGE_FORMAT(3);
/* The same with the model's words. */
fmu_status component_fail_as_model(component* c, fmu_function function);

/* While waiting for the first sample: as if it were taken now, until model_end_trial(). FMU_WARNING, which is logged:
 * there is none of these inputs, and nothing to be ended. */
fmu_status component_begin_trial(component* c, fmu_function function);

/* While waiting: brings the outputs up to the present inputs; to 0 with FMU_WARNING. */
fmu_status component_update_outputs(component* c, fmu_function function);

/* Defines a function of FMI that hands its arguments on. */
#define FMI_CALL(status, function, parameters, call) \
  status function parameters {                       \
    return (status)call;                             \
  }

/* --- life --------------------------------------------------------------------------------------------------------- */

/* What the functions of both versions of FMI do; the caller adds types and arguments of its own version. */

/* NULL, with the reason in the log. `identifier` is what the importer read in modelDescription.xml, `resources` the URI
 * or path of the folder. */
component* life_create(const log_target* log, const char* identifier, const char* resources);
component* life_refuse(const log_target* log, const char* format, ...) MESSAGE_FORMAT(2);

fmu_status life_set_logging(component* c, int on, size_t count, const char* const categories[]);

typedef struct experiment {
  int tolerance_defined, stop_time_defined;
  double tolerance, start_time, stop_time;
} experiment;

/* `function` is the one that brings the experiment: not the same in both versions. */
fmu_status life_set_experiment(component* c, fmu_function function, const experiment* e);
fmu_status life_enter_initialisation(component* c);
fmu_status life_exit_initialisation(component* c);
fmu_status life_terminate(component* c);
fmu_status life_reset(component* c);
fmu_status life_step(component* c, double time, double step);
