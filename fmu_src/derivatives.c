#include "derivatives.h"

#include <math.h>
#include <string.h>

#include "values.h"

/* Directions of the inputs and derivatives of the outputs, laid out as the variables are, in room of the model. */
static variables lay_out(const component* c) {
  variables view = c->values;
  double* room = view.derivatives;
  memset(room, 0, (view.input_count + view.output_count) * sizeof *room);
  for (int g = 0; g < GROUP_COUNT; ++g) {
    const int laid_out = variable_groups[g].causality != CAUSALITY_PARAMETER && view.number[g];
    view.flag[g] = NULL;
    view.number[g] = laid_out ? room + (view.number[g] - view.numbers) : NULL;
  }
  return view;
}

/* --- finding ------------------------------------------------------------------------------------------------------ */

/* A Real input or output, as wanted. */
static fmu_status find_for_derivative(component* c, fmu_function function, unsigned reference,
                                      variable_causality wanted, variable* found) {
  if (find_of_type(c, function, VARIABLE_REAL, reference, found)) {
    return FMU_ERROR;
  }
  if (variable_causality_of(found) != wanted) {
    return fail_at(c, function, found,
                   wanted == CAUSALITY_INPUT ? "not a known: derivatives are by the inputs"
                                             : "not an unknown: derivatives are those of the Real outputs");
  }
  return found->group->discrete ? fail_at(c, function, found, "discrete: it has no derivative") : FMU_OK;
}

static fmu_status check_references(component* c, fmu_function function, const unsigned references[], size_t count,
                                   variable_causality wanted) {
  variable found = {0};
  for (size_t i = 0; i < count; ++i) {
    if (find_for_derivative(c, function, references[i], wanted, &found)) {
      return FMU_ERROR;
    }
  }
  return FMU_OK;
}

/* 1 when the call is allowed and the request is one; otherwise logs and fails. `in` are the variables of the seed. */
static int is_sound(component* c, fmu_function function, const partials* p, const references* in,
                    const references* out) {
  if (!component_may_call(c, function)) {
    return 0;
  }
  if (model_text.no_derivatives) {
    component_fail(c, call_name(function), "%s", model_text.no_derivatives);
    return 0;
  }
  if (!may_access(c, function, out->count, out->references, p->sensitivity) ||
      !may_access(c, function, in->count, in->references, p->seed) ||
      check_references(c, function, p->knowns.references, p->knowns.count, CAUSALITY_INPUT) ||
      check_references(c, function, p->unknowns.references, p->unknowns.count, CAUSALITY_OUTPUT) ||
      check_value_count(c, function, VARIABLE_REAL, in->references, in->count, p->seed_count, "nSeed") ||
      check_value_count(c, function, VARIABLE_REAL, out->references, out->count, p->sensitivity_count,
                        "nSensitivity")) {
    return 0;
  }
  for (size_t i = 0; i < p->seed_count; ++i) {
    if (!isfinite(p->seed[i])) {
      component_fail(c, call_name(function), "a number of the seed (dvKnown) is not finite");
      return 0;
    }
  }
  return 1;
}

/* --- numbers ------------------------------------------------------------------------------------------------------ */

/* The next element of a list of variables; NULL after the last one. Starts with zeros. */
typedef struct place {
  size_t at, element;
  variable found;
} place;

static double* next_number(const variables* view, const references* list, place* p) {
  while (p->at < list->count) {
    variables_find(view, list->references[p->at], &p->found);
    if (p->element < variables_extent(view, &p->found)) {
      const variable one = variables_element(&p->found, p->element++);
      return variables_number(view, &one);
    }
    ++p->at;
    p->element = 0;
  }
  return NULL;
}

/* Until the first sample is taken derivatives are those of a sample taken for the time being. Where there is none, with
 * FMU_WARNING, outputs are 0, and so are derivatives. */
static fmu_status begin_derivatives(component* c, fmu_function function) {
  return c->waiting && !c->failed ? component_begin_trial(c, function) : FMU_OK;
}

/* Ends what begin_derivatives() began, with what model_derive() returned. */
static fmu_status end_derivatives(component* c, fmu_function function, int status) {
  if (c->waiting && !c->failed) {
    model_end_trial(c->model);
  }
  return status ? component_fail_as_model(c, function) : FMU_OK;
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

fmu_status derivatives_directional(component* c, const partials* p) {
  const fmu_function function = CALL_GET_DIRECTIONAL_DERIVATIVE;
  place known = {0}, unknown = {0};
  if (!is_sound(c, function, p, &p->knowns, &p->unknowns)) {
    return FMU_ERROR;
  }
  const variables view = lay_out(c);
  const double* seed = p->seed;
  for (double* number; (number = next_number(&view, &p->knowns, &known)) != NULL;) {
    *number += *seed++;
  }
  fmu_status status = begin_derivatives(c, function);
  if (status == FMU_OK) {
    status = end_derivatives(c, function, model_derive(c->model, &view));
  }
  double* sensitivity = p->sensitivity;
  for (const double* number; status != FMU_ERROR && (number = next_number(&view, &p->unknowns, &unknown)) != NULL;) {
    *sensitivity++ = *number;
  }
  return status;
}

/* the seed times the derivatives that stand in the layout */
static double weighted_sum(const variables* view, const partials* p) {
  place unknown = {0};
  double sum = 0.0;
  const double* seed = p->seed;
  for (const double* number; (number = next_number(view, &p->unknowns, &unknown)) != NULL;) {
    sum += *seed++ * *number;
  }
  return sum;
}

/* One directional derivative for each element of the knowns: at most 160 of them. */
fmu_status derivatives_adjoint(component* c, const partials* p) {
  const fmu_function function = CALL_GET_ADJOINT_DERIVATIVE;
  place known = {0};
  if (!is_sound(c, function, p, &p->unknowns, &p->knowns)) {
    return FMU_ERROR;
  }
  const variables view = lay_out(c);
  const fmu_status begun = begin_derivatives(c, function);
  int status = 0;
  double* sensitivity = p->sensitivity;
  if (begun != FMU_OK) {
    memset(sensitivity, 0, p->sensitivity_count * sizeof *sensitivity);
    return begun;
  }
  for (double* number; !status && (number = next_number(&view, &p->knowns, &known)) != NULL;) {
    *number = 1.0;
    status = model_derive(c->model, &view);
    *number = 0.0;
    *sensitivity++ = weighted_sum(&view, p);
  }
  return end_derivatives(c, function, status);
}
