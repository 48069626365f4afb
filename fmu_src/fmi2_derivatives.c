/* FMI 2.0, directional derivatives of the friction model. */
#include <math.h>
#include <string.h>

#include "component.h"
#include "finger_model.h"
#include "finger_signals.h"
#include "fmi2Functions.h"
#include "variable_access.h"

/* Directions of the inputs and derivatives of the outputs, laid out as the variables are, in room of the model. */
static variables lay_out(const component* c) {
  variables view = c->values;
  double* room = model_derivatives(c->model);
  memset(room, 0, (view.input_count + view.output_count) * sizeof *room);
  for (int g = 0; g < GROUP_COUNT; ++g) {
    const int laid_out = variable_groups[g].causality != CAUSALITY_PARAMETER && view.number[g];
    view.flag[g] = NULL;
    view.number[g] = laid_out ? room + (view.number[g] - view.numbers) : NULL;
  }
  return view;
}

/* 0 when the reference is a Real input or output, as wanted */
static int find_for_derivative(component* c, fmi2ValueReference reference, variable_causality wanted, variable* found) {
  const fmu_function function = CALL_GET_DIRECTIONAL_DERIVATIVE;
  if (find_of_type(c, function, VARIABLE_REAL, reference, found)) {
    return -1;
  }
  if (variable_causality_of(found) != wanted) {
    fail_at(c, function, found,
            wanted == CAUSALITY_INPUT ? "not a known: derivatives are by the inputs"
                                      : "not an unknown: derivatives are those of the Real outputs");
    return -1;
  }
  if (found->group->discrete) {
    fail_at(c, function, found, "discrete: it has no derivative");
    return -1;
  }
  return 0;
}

static int read_direction(component* c, const variables* view, const fmi2ValueReference known[], size_t count,
                          const double values[]) {
  variable found = {0};
  for (size_t i = 0; i < count; ++i) {
    if (find_for_derivative(c, known[i], CAUSALITY_INPUT, &found)) {
      return -1;
    }
    if (!isfinite(values[i])) {
      fail_at(c, CALL_GET_DIRECTIONAL_DERIVATIVE, &found, "its dvKnown is not finite");
      return -1;
    }
    *variables_number(view, &found) += values[i];
  }
  return 0;
}

/* at the sample last taken, or in initialisation mode at the first one, taken for the time being */
static int derive(component* c, const variables* view) {
  const tendonfmu_inputs direction = variables_inputs(view);
  const tendonfmu_outputs derivative = variables_outputs(view);
  const int trial = !c->failed && c->phase == PHASE_INITIALISATION;
  if (trial && model_begin_trial(c->model, &c->values, c->start_time)) {
    return -1;
  }
  const tendonfmu_status status = tendonfmu_get_directional_derivative(model_finger(c->model), &direction, &derivative);
  if (trial) {
    model_end_trial(c->model);
  }
  return status == TENDONFMU_OK ? 0 : -1;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
  const fmu_function function = CALL_GET_DIRECTIONAL_DERIVATIVE;
  component* c = instance;
  variable found = {0};
  if (!may_access(c, function, nUnknown, vUnknown_ref, dvUnknown) ||
      !may_access(c, function, nKnown, vKnown_ref, dvKnown)) {
    return fmi2Error;
  }
  const variables view = lay_out(c);
  if (read_direction(c, &view, vKnown_ref, nKnown, dvKnown)) {
    return fmi2Error;
  }
  for (size_t i = 0; i < nUnknown; ++i) {
    if (find_for_derivative(c, vUnknown_ref[i], CAUSALITY_OUTPUT, &found)) {
      return fmi2Error;
    }
  }
  if (derive(c, &view)) {
    return component_fail_because(c, call_name(function), model_last_error(c->model));
  }
  for (size_t i = 0; i < nUnknown; ++i) {
    variables_find(&c->values, vUnknown_ref[i], &found);
    dvUnknown[i] = *variables_number(&view, &found);
  }
  return fmi2OK;
}
