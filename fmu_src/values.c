#include "values.h"

#include <string.h>

fmu_status fail_at(component* c, fmu_function function, const variable* found, const char* reason) {
  return component_fail(c, call_name(function), "%s: %s", variables_name(c->model, found).bytes, reason);
}

fmu_status fail_of_type(component* c, fmu_function function, unsigned reference, const char* type, variable* found) {
  if (variables_find(&c->values, reference, found)) {
    return component_fail(c, call_name(function), "no variable has the value reference %zu", (size_t)reference);
  }
  return component_fail(c, call_name(function), "%s is of type %s, expected %s", variables_name(c->model, found).bytes,
                        this_fmi.types[variable_type_of(found)], type);
}

int may_access(component* c, fmu_function function, size_t count, const void* references, const void* values) {
  if (!component_may_call(c, function)) {
    return 0;
  }
  if (count && (!references || !values)) {
    component_fail(c, call_name(function), "%s is NULL", references ? this_fmi.values : this_fmi.references);
    return 0;
  }
  return 1;
}

fmu_status check_value_count(component* c, fmu_function function, variable_type type, const unsigned references[],
                             size_t count, size_t value_count, const char* argument) {
  variable found = {0};
  size_t expected = this_fmi.arrays ? 0 : count;
  for (size_t i = 0; this_fmi.arrays && i < count; ++i) {
    if (find_of_type(c, function, type, references[i], &found)) {
      return FMU_ERROR;
    }
    expected += variables_extent(&c->values, &found);
  }
  return expected == value_count
             ? FMU_OK
             : component_fail(c, call_name(function), "%s = %zu: expected %zu, the elements of all variables together",
                              argument, value_count, expected);
}

/* Where the variables of a call live, as many as `places` holds, into it. What is wrong with one of them is said. */
static fmu_status find_places(component* c, fmu_function function, variable_type type, const unsigned references[],
                              size_t count, variable_places* places) {
  variable found = {0};
  const size_t known = places->references;
  if (known && known <= count && memcmp(places->of, references, known * sizeof *references) == 0) {
    return FMU_OK;
  }
  memset(places, 0, offsetof(variable_places, of));
  for (size_t i = 0; i < count; ++i) {
    if (find_of_type(c, function, type, references[i], &found)) {
      places->references = 0;
      return FMU_ERROR;
    }
    const size_t extent = variables_extent(&c->values, &found), first = variables_place(&c->values, &found);
    if (places->elements + extent > PLACES_MOST) {
      break;
    }
    for (size_t k = 0; k < extent; ++k) {
      places->place[places->elements++] = (unsigned)(first + k);
    }
    places->apart |= first + extent != places->place[0] + places->elements;
    places->of[places->references++] = references[i];
    places->inputs |= variable_causality_of(&found) == CAUSALITY_INPUT;
    places->outputs |= variable_causality_of(&found) == CAUSALITY_OUTPUT;
    places->parameters |= variable_causality_of(&found) == CAUSALITY_PARAMETER;
  }
  return FMU_OK;
}

/* --- elements of arrays of the importer --------------------------------------------------------------------------- */

/* a value as one of a variable: for a Boolean every number but 0 is true */
static double given_value(const void* values, value_format format, size_t at, variable_type type) {
  double value;
  switch (format) {
    case VALUES_INT: value = ((const int*)values)[at]; break;
    case VALUES_BOOL: value = ((const _Bool*)values)[at]; break;
    default: value = ((const double*)values)[at]; break;
  }
  return type == VARIABLE_BOOLEAN ? value != 0.0 : value;
}

static void put_value(void* values, value_format format, size_t at, double value) {
  switch (format) {
    case VALUES_INT: ((int*)values)[at] = (int)value; break;
    case VALUES_BOOL: ((_Bool*)values)[at] = value != 0.0; break;
    default: ((double*)values)[at] = value; break;
  }
}

/* Whether the values of a round stand in both arrays one after another, in the same format. */
static int is_a_copy(const variable_places* places, variable_type type, value_format format) {
  return !places->apart && type == VARIABLE_REAL && format == VALUES_DOUBLE;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* Until the first sample is taken outputs follow the inputs; before the initialisation mode there are none. */
static fmu_status update_outputs(component* c, fmu_function function, const unsigned references[], size_t count) {
  variable found = {0};
  for (size_t i = 0; !c->failed && c->phase == PHASE_INSTANTIATED && i < count; ++i) {
    variables_find(&c->values, references[i], &found);
    if (variable_causality_of(&found) == CAUSALITY_OUTPUT) {
      return fail_at(c, function, &found, "an output has no value before the initialisation mode");
    }
  }
  return component_update_outputs(c, function);
}

fmu_status values_get(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, void* values, size_t value_count) {
  size_t at = 0;
  fmu_status status = FMU_OK;
  if (!may_access(c, function, count, references, values) ||
      check_value_count(c, function, type, references, count, value_count, "nValues")) {
    return FMU_ERROR;
  }
  const variables* v = &c->values;
  variable_places* places = &c->read[type];
  for (size_t i = 0; i < count && status != FMU_ERROR; i += places->references) {
    if (find_places(c, function, type, references + i, count - i, places)) {
      return FMU_ERROR;
    }
    if (c->waiting && places->outputs) { /* later a step brings the outputs with it */
      status = update_outputs(c, function, places->of, places->references);
    }
    if (is_a_copy(places, type, format)) {
      memcpy((double*)values + at, v->numbers + places->place[0], places->elements * sizeof(double));
      at += places->elements;
      continue;
    }
    for (size_t k = 0; k < places->elements; ++k) {
      const size_t place = places->place[k];
      put_value(values, format, at++, place < v->number_count ? v->numbers[place] : v->flags[place - v->number_count]);
    }
  }
  return status;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* Whether the variable may be written now, whatever the value. */
static fmu_status check_writable(component* c, fmu_function function, const variable* found) {
  if (variable_causality_of(found) == CAUSALITY_OUTPUT) {
    return fail_at(c, function, found, "an output is not written");
  }
  if (variables_number(&c->values, found) == c->values.time) {
    return fail_at(c, function, found, "the independent variable is not written");
  }
  if (c->phase != PHASE_STEP_COMPLETE || (!found->group && model_parameter_range(c->model, found->index).tunable)) {
    return FMU_OK;
  }
  return component_fail(c, call_name(function), "%s: a fixed parameter is written before %s only",
                        variables_name(c->model, found).bytes, call_name(CALL_EXIT_INITIALIZATION_MODE));
}

/* Whether the variables may have their values, which stand in `values` from `at` on: one by one, the first that is
 * refused is named. Inputs, all of them Real, may have any, since the step alone may discard them. */
static fmu_status check_values(component* c, fmu_function function, const variable_places* places, const void* values,
                               value_format format, size_t at) {
  variable found = {0};
  for (size_t i = 0; i < places->references; ++i) {
    variables_find(&c->values, places->of[i], &found);
    const int is_input = variable_causality_of(&found) == CAUSALITY_INPUT;
    if (!is_input && check_writable(c, function, &found)) {
      return FMU_ERROR;
    }
    for (size_t k = 0; k < variables_extent(&c->values, &found); ++k, ++at) {
      const variable one = variables_element(&found, k);
      const double value = given_value(values, format, at, variable_type_of(&found));
      if (!is_input && !variables_accept(c->model, &one, value)) {
        return component_fail(c, call_name(function), "%s", variables_refusal(c->model, &one, value).bytes);
      }
    }
  }
  return FMU_OK;
}

/* Hands the model the settings that were written. */
static void give_settings(component* c, const variable_places* places) {
  variable found = {0};
  for (size_t i = 0; i < places->references; ++i) {
    variables_find(&c->values, places->of[i], &found);
    c->values.parameters_pending |= !found.group;
    const int is_setting = found.group && found.group->causality == CAUSALITY_PARAMETER;
    for (size_t k = 0; is_setting && k < variables_extent(&c->values, &found); ++k) {
      model_set_setting(c->model, found.id, found.index + k, variables_number(&c->values, &found)[k]);
    }
  }
}

fmu_status values_set(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, const void* values, size_t value_count) {
  if (!may_access(c, function, count, references, values) ||
      check_value_count(c, function, type, references, count, value_count, "nValues")) {
    return FMU_ERROR;
  }
  variable_places* places = &c->written[type];
  for (size_t i = 0, at = 0; i < count; i += places->references, at += places->elements) { /* all or none */
    if (find_places(c, function, type, references + i, count - i, places) ||
        ((places->outputs || places->parameters) && check_values(c, function, places, values, format, at))) {
      return FMU_ERROR;
    }
  }
  for (size_t i = 0, at = 0; i < count; i += places->references) {
    find_places(c, function, type, references + i, count - i, places);
    if (is_a_copy(places, type, format)) {
      memcpy(c->values.numbers + places->place[0], (const double*)values + at, places->elements * sizeof(double));
      at += places->elements;
    } else {
      for (size_t k = 0; k < places->elements; ++k) {
        c->values.numbers[places->place[k]] = given_value(values, format, at++, type);
      }
    }
    if (places->parameters) {
      give_settings(c, places);
    }
    c->outputs_pending = 1;
    c->inputs_given |= places->inputs;
  }
  return FMU_OK;
}

fmu_status values_refuse(component* c, fmu_function function, const char* type, const unsigned references[],
                         size_t count, const void* values) {
  variable found = {0};
  if (!may_access(c, function, count, references, values)) {
    return FMU_ERROR;
  }
  return count ? fail_of_type(c, function, references[0], type, &found) : FMU_OK;
}
