/* One instance of the FMU: a finger, its variables, and where it stands in the life that FMI 2.0 prescribes. */
#ifndef TENDONFMU_COMPONENT_H
#define TENDONFMU_COMPONENT_H

#include "call_table.h"
#include "log.h"
#include "tendonfmu.h"
#include "variables.h"

typedef struct component {
  log_target log;
  char* instance_name;
  tendonfmu_finger* finger;
  variables values;

  fmu_phase phase;
  int failed;             /* fmi2Error was returned: state "error" on top of the phase */
  int parameters_pending; /* values.parameters may differ from those of the finger */
  int outputs_pending;    /* in initialisation mode: outputs do not belong to the present inputs */
  int stop_time_defined;
  double start_time, stop_time, end_of_step;

  void* scratch; /* [state_size] a state of the finger to go back to */
  size_t state_size;
  size_t* changed_indices; /* [p] parameters to hand over */
  double* changed_values;  /* [p] */
  double* derivatives;     /* inputs and outputs, laid out as in values */
} component;

/* Takes over finger and a copy of the name. NULL when memory is out; the finger is then destroyed. */
component* component_create(const log_target* log, tendonfmu_finger* finger);
void component_destroy(component* c);

/* Back to what component_create() gave; logging stays as it is set. */
void component_reset(component* c);

/* 1 when the function may be called now; otherwise logs and fails. c may be NULL: 0. */
int component_may_call(component* c, fmu_function function);

/* Logs the text as an error, enters the state "error" and returns fmi2Error. */
fmi2Status component_fail(component* c, const log_text* text);
/* The same with "<function>: <reason>". */
fmi2Status component_fail_because(component* c, const char* function, const char* reason);

/* Takes a sample of the present inputs at a time, the first one by initialising; parameters that were written take
 * effect in it. 0, or -1 with everything as it was and the reason in tendonfmu_last_error(). */
int component_take_sample(component* c, double time);

/* In initialisation mode: takes the first sample for the time being, and goes back to before it. In between, outputs
 * and derivatives can be read from the finger. begin: 0, or -1 with everything as it was. */
int component_begin_trial(component* c);
void component_end_trial(component* c);

/* Copies the outputs of the sample last taken into the variables. */
void component_fetch_outputs(component* c);

#endif
