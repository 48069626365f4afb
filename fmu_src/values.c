#include "values.h"

#include <string.h>

fmu_status fail_at(component* c, fmu_function function, const variable* found, const char* reason) {
  return component_fail(c, call_name(function), "%s: %s", variables_name(c->model, found).bytes, reason);
}

fmu_status fail_of_type(component* c, fmu_function function, unsigned reference, const char* type, variable* found) {
  log_text name = log_line("time");
  variable_type of_name = VARIABLE_REAL;
  if (variables_find(&c->values, reference, found) == 0) {
    name = variables_name(c->model, found);
    of_name = variable_type_of(found);
  } else if (!is_time(reference, VARIABLE_REAL)) {
    return component_fail(c, call_name(function), "no variable has the value reference %zu", (size_t)reference);
  }
  return component_fail(c, call_name(function), "%s is of type %s, expected %s", name.bytes, this_fmi.types[of_name],
                        type);
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
    if (is_time(references[i], type)) {
      ++expected;
    } else if (find_of_type(c, function, type, references[i], &found)) {
      return FMU_ERROR;
    } else {
      expected += variables_extent(&c->values, &found);
    }
  }
  return expected == value_count
             ? FMU_OK
             : component_fail(c, call_name(function), "%s = %zu: expected %zu, the elements of all variables together",
                              argument, value_count, expected);
}

/* A run: variables of a call whose numbers follow one another, found by the first of their value references. What an
 * importer reads and writes in each step are a few runs of inputs and outputs, which are copied as blocks. */
typedef struct value_run {
  variable first;
  size_t references; /* how many of the call */
  size_t elements;   /* their numbers */
} value_run;

/* The run that begins with references[0] [count]; otherwise says what is wrong with that one and fails. */
static fmu_status find_run(component* c, fmu_function function, variable_type type, const unsigned references[],
                           size_t count, value_run* run) {
  if (find_of_type(c, function, type, references[0], &run->first)) {
    return FMU_ERROR;
  }
  run->references = variables_run(&c->values, &run->first, references, count);
  run->elements = run->first.whole ? c->values.count[run->first.id] : run->references;
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

/* Numbers, or flags in their place, which are read as Booleans: never into doubles. */
static void put_values(void* values, value_format format, size_t at, const double* numbers, const unsigned char* flags,
                       size_t count) {
  switch (format) {
    case VALUES_INT:
      for (size_t i = 0; i < count; ++i) {
        ((int*)values)[at + i] = flags ? flags[i] : (int)numbers[i];
      }
      break;
    case VALUES_BOOL:
      for (size_t i = 0; i < count; ++i) {
        ((_Bool*)values)[at + i] = flags ? flags[i] != 0 : numbers[i] != 0.0;
      }
      break;
    default: memcpy((double*)values + at, numbers, count * sizeof *numbers); break;
  }
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* Until the first sample is taken outputs follow the inputs; before the initialisation mode there are none. */
static fmu_status update_outputs(component* c, fmu_function function, const variable* found) {
  if (!c->waiting || variable_causality_of(found) != CAUSALITY_OUTPUT) {
    return FMU_OK; /* a step brings the outputs with it */
  }
  if (!c->failed && c->phase == PHASE_INSTANTIATED) {
    return fail_at(c, function, found, "an output has no value before the initialisation mode");
  }
  return component_update_outputs(c, function);
}

fmu_status values_get(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, void* values, size_t value_count) {
  value_run run;
  size_t at = 0;
  fmu_status status = FMU_OK;
  if (!may_access(c, function, count, references, values) ||
      check_value_count(c, function, type, references, count, value_count, "nValues")) {
    return FMU_ERROR;
  }
  for (size_t i = 0; i < count; i += run.references, at += run.elements) {
    if (is_time(references[i], type)) {
      run.references = run.elements = 1;
      put_values(values, format, at, &c->end_of_step, NULL, 1);
      continue;
    }
    if (find_run(c, function, type, references + i, count - i, &run)) {
      return FMU_ERROR;
    }
    const fmu_status updated = update_outputs(c, function, &run.first);
    if (updated == FMU_ERROR) {
      return updated;
    }
    status = updated > status ? updated : status;
    const int is_flag = variable_is_flag(&run.first);
    put_values(values, format, at, is_flag ? NULL : variables_number(&c->values, &run.first),
               is_flag ? c->values.flag[run.first.id] + run.first.index : NULL, run.elements);
  }
  return status;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* Whether the variable may be written now, whatever the value. */
static fmu_status check_writable(component* c, fmu_function function, const variable* found) {
  if (variable_causality_of(found) == CAUSALITY_OUTPUT) {
    return fail_at(c, function, found, "an output is not written");
  }
  if (c->phase != PHASE_STEP_COMPLETE || (!found->group && model_parameter_range(c->model, found->index).tunable)) {
    return FMU_OK;
  }
  return component_fail(c, call_name(function), "%s: a fixed parameter is written before %s only",
                        variables_name(c->model, found).bytes, call_name(CALL_EXIT_INITIALIZATION_MODE));
}

/* Inputs, all of them Real: taken as they stand, whatever they are, since the step alone may discard them. */
static int is_block(const value_run* run) {
  return variable_causality_of(&run->first) == CAUSALITY_INPUT;
}

/* Whether every variable of the run may have its value, which stand in `values` from `at` on. */
static fmu_status check_run(component* c, fmu_function function, const value_run* run, const void* values,
                            value_format format, size_t at) {
  const variable_type type = variable_type_of(&run->first);
  for (size_t i = 0; !is_block(run) && i < run->elements; ++i) { /* one by one: the first that is refused is named */
    const variable one = variables_element(&run->first, i);
    const double value = given_value(values, format, at + i, type);
    if (check_writable(c, function, run->first.whole ? &run->first : &one)) {
      return FMU_ERROR;
    }
    if (!variables_accept(c->model, &one, value)) {
      return component_fail(c, call_name(function), "%s", variables_refusal(c->model, &one, value).bytes);
    }
  }
  return FMU_OK;
}

/* Values that check_run() took. */
static void take_run(component* c, const value_run* run, const void* values, value_format format, size_t at) {
  double* numbers = variables_number(&c->values, &run->first);
  const variable_group* group = run->first.group;
  c->outputs_pending = 1;
  if (is_block(run)) {
    c->inputs_given = 1;
    memcpy(numbers, (const double*)values + at, run->elements * sizeof *numbers);
    return;
  }
  for (size_t i = 0; i < run->elements; ++i) {
    numbers[i] = given_value(values, format, at + i, variable_type_of(&run->first));
    if (group && group->causality == CAUSALITY_PARAMETER) {
      model_set_setting(c->model, run->first.id, run->first.index + i, numbers[i]);
    }
  }
  c->values.parameters_pending |= !group;
}

fmu_status values_set(component* c, fmu_function function, variable_type type, const unsigned references[],
                      size_t count, value_format format, const void* values, size_t value_count) {
  value_run run;
  size_t at = 0;
  if (!may_access(c, function, count, references, values) ||
      check_value_count(c, function, type, references, count, value_count, "nValues")) {
    return FMU_ERROR;
  }
  for (size_t i = 0; i < count; i += run.references, at += run.elements) { /* all or none */
    if (is_time(references[i], type)) {
      return component_fail(c, call_name(function), "time: the independent variable is not written");
    }
    if (find_run(c, function, type, references + i, count - i, &run) ||
        check_run(c, function, &run, values, format, at)) {
      return FMU_ERROR;
    }
  }
  at = 0;
  for (size_t i = 0; i < count; i += run.references, at += run.elements) {
    find_run(c, function, type, references + i, count - i, &run);
    take_run(c, &run, values, format, at);
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
