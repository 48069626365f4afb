#include "variables.h"

#include <stdlib.h>
#include <string.h>

/* Elements of a group; 0 where the model does not have what it needs. */
static size_t count_elements(const model_shape* shape, const variable_group* group) {
  if ((group->needs == NEEDS_LINKS && !shape->has_links) ||
      (group->needs == NEEDS_SENSOR_FAULT && !shape->watches_sensors)) {
    return 0;
  }
  switch (group->size) {
    case SIZE_JOINTS: return shape->joints;
    case SIZE_TENDONS: return shape->tendons;
    case SIZE_VECTOR: return 3;
    default: return 1;
  }
}

/* Groups that live in the block of numbers: all but Boolean outputs. */
static int has_numbers(const variable_group* group) {
  return group->type != VARIABLE_BOOLEAN || group->causality == CAUSALITY_PARAMETER;
}

/* Gives each group of one causality its part of a block, NULL to count; returns how many numbers they have. */
static size_t share_out(variables* v, variable_causality causality, double* block) {
  size_t used = 0;
  for (int g = 0; g < GROUP_COUNT; ++g) {
    if (has_numbers(&variable_groups[g]) && variable_groups[g].causality == causality) {
      v->number[g] = block && v->count[g] ? block + used : NULL;
      used += v->count[g];
    }
  }
  return used;
}

static size_t share_out_flags(variables* v, unsigned char* block) {
  size_t used = 0;
  for (int g = 0; g < GROUP_COUNT; ++g) {
    if (!has_numbers(&variable_groups[g])) {
      v->flag[g] = block && v->count[g] ? block + used : NULL;
      used += v->count[g];
    }
  }
  return used;
}

int variables_create(variables* v, const model* m, int arrays) {
  memset(v, 0, sizeof *v);
  v->arrays = arrays;
  const model_shape shape = model_get_shape(m);
  v->parameter_count = shape.parameters;
  for (int g = 0; g < GROUP_COUNT; ++g) {
    v->count[g] = count_elements(&shape, &variable_groups[g]);
  }
  v->input_count = share_out(v, CAUSALITY_INPUT, NULL);
  v->output_count = share_out(v, CAUSALITY_OUTPUT, NULL);
  const size_t settings = share_out(v, CAUSALITY_PARAMETER, NULL);
  v->number_count = v->input_count + v->output_count + settings + v->parameter_count + 1;
  v->numbers = calloc(v->number_count + v->input_count + v->output_count, sizeof(double));
  v->flags = calloc(share_out_flags(v, NULL), 1);
  if (!v->numbers || !v->flags) {
    return -1;
  }
  share_out_flags(v, v->flags);
  double* outputs = v->numbers + share_out(v, CAUSALITY_INPUT, v->numbers);
  double* of_settings = outputs + share_out(v, CAUSALITY_OUTPUT, outputs);
  v->parameters = of_settings + share_out(v, CAUSALITY_PARAMETER, of_settings);
  v->time = v->parameters + v->parameter_count;
  v->derivatives = v->numbers + v->number_count;
  variables_start(v, m);
  return 0;
}

void variables_destroy(variables* v) {
  free(v->numbers);
  free(v->flags);
}

void variables_clear_outputs(variables* v) {
  memset(v->numbers + v->input_count, 0, v->output_count * sizeof(double));
  memset(v->flags, 0, share_out_flags(v, v->flags));
}

void variables_start(variables* v, const model* m) {
  memset(v->numbers, 0, v->input_count * sizeof(double));
  variables_clear_outputs(v);
  variables_fetch_settings(v, m);
  model_get_parameters(m, v->parameters);
  v->parameters_pending = 0;
}

void variables_fetch_settings(variables* v, const model* m) {
  for (int g = 0; g < GROUP_COUNT; ++g) {
    const size_t count = variable_groups[g].causality == CAUSALITY_PARAMETER ? v->count[g] : 0;
    for (size_t i = 0; i < count; ++i) {
      v->number[g][i] = model_get_setting(m, (variable_group_id)g, i);
    }
  }
}

/* unit, minimum, maximum of an input or parameter */
static model_range range_of(const model* m, const variable* found) {
  if (!found->group) {
    return model_parameter_range(m, found->index);
  }
  if (found->group->causality == CAUSALITY_PARAMETER) {
    return model_setting_range(m, found->id);
  }
  return (model_range){.unit = found->group->unit, .minimum = found->group->minimum, .maximum = found->group->maximum};
}

int variables_accept(const model* m, const variable* found, double value) {
  const model_range range = range_of(m, found);
  return value <= range.maximum && (range.above_minimum ? value > range.minimum : value >= range.minimum);
}

log_text variables_refusal(const model* m, const variable* found, double value) {
  const model_range range = range_of(m, found);
  const char* from = range.above_minimum ? "above " : "";
  const char* to = range.above_minimum ? "and at most" : "to";
  const int has_unit = range.unit && *range.unit;
  return log_line("%s = %g: expected %s%g %s %g%s%s", variables_name(m, found).bytes, value, from, range.minimum, to,
                  range.maximum, has_unit ? " " : "", has_unit ? range.unit : "");
}

log_text variables_name(const model* m, const variable* found) {
  char path[128];
  if (!found->group) {
    return log_line("%s", model_parameter_path(m, found->index, path, sizeof path) == 0 ? path : "time");
  }
  return found->group->size == SIZE_SCALAR || found->whole ? log_line("%s", found->group->name)
                                                           : log_line("%s[%zu]", found->group->name, found->index + 1);
}
