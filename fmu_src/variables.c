#include "variables.h"

#include <stdlib.h>
#include <string.h>

size_t variables_group_count(const variables* v, const variable_group* group) {
  switch (group->size) {
    case SIZE_JOINTS: return v->joints;
    case SIZE_TENDONS: return v->tendons;
    default: return 1;
  }
}

/* Numbers of all Real groups of one causality. */
static size_t real_count(const variables* v, variable_causality causality) {
  size_t count = 0;
  for (int g = 0; g < GROUP_COUNT; ++g) {
    if (variable_groups[g].type == VARIABLE_REAL && variable_groups[g].causality == causality) {
      count += variables_group_count(v, &variable_groups[g]);
    }
  }
  return count;
}

/* Gives each Real group of one causality its part of the block; returns what is left of it. */
static double* share_out(variables* v, variable_causality causality, double* block) {
  for (int g = 0; g < GROUP_COUNT; ++g) {
    if (variable_groups[g].type == VARIABLE_REAL && variable_groups[g].causality == causality) {
      v->real[g] = block;
      block += variables_group_count(v, &variable_groups[g]);
    }
  }
  return block;
}

static size_t share_out_flags(variables* v, unsigned char* block) {
  size_t used = 0;
  for (int g = 0; g < GROUP_COUNT; ++g) {
    if (variable_groups[g].type == VARIABLE_BOOLEAN) {
      v->flag[g] = block ? block + used : NULL;
      used += variables_group_count(v, &variable_groups[g]);
    }
  }
  return used;
}

int variables_create(variables* v, const tendonfmu_finger* finger) {
  memset(v, 0, sizeof *v);
  v->joints = tendonfmu_joint_count(finger);
  v->tendons = tendonfmu_tendon_count(finger);
  v->parameter_count = tendonfmu_parameter_count(finger);
  v->input_count = real_count(v, CAUSALITY_INPUT);
  v->output_count = real_count(v, CAUSALITY_OUTPUT);
  v->numbers = calloc(v->input_count + v->output_count + v->parameter_count, sizeof(double));
  v->flags = calloc(share_out_flags(v, NULL), 1);
  if (!v->numbers || !v->flags) {
    return -1;
  }
  share_out_flags(v, v->flags);
  v->parameters = share_out(v, CAUSALITY_OUTPUT, share_out(v, CAUSALITY_INPUT, v->numbers));
  variables_start(v, finger);
  return 0;
}

void variables_destroy(variables* v) {
  free(v->numbers);
  free(v->flags);
}

void variables_start(variables* v, const tendonfmu_finger* finger) {
  memset(v->numbers, 0, (v->input_count + v->output_count) * sizeof(double));
  memset(v->flags, 0, share_out_flags(v, v->flags));
  tendonfmu_get_parameters(finger, v->parameter_count, NULL, v->parameters);
}

/* 1 when the reference lies in the group; then index is set */
static int in_group(const variables* v, unsigned value_reference, variable_group_id id, variable* found) {
  const variable_group* group = &variable_groups[id];
  if (value_reference < group->base || value_reference - group->base >= variables_group_count(v, group)) {
    return 0;
  }
  *found = (variable){group, id, value_reference - group->base};
  return 1;
}

int variables_find(const variables* v, unsigned value_reference, variable* last) {
  if (value_reference >= VARIABLE_PARAMETER_BASE) {
    *last = (variable){NULL, GROUP_COUNT, value_reference - VARIABLE_PARAMETER_BASE};
    return last->index < v->parameter_count ? 0 : -1;
  }
  if (last->group && in_group(v, value_reference, last->id, last)) {
    return 0;
  }
  for (int g = 0; g < GROUP_COUNT; ++g) {
    if (in_group(v, value_reference, (variable_group_id)g, last)) {
      return 0;
    }
  }
  return -1;
}

variable_type variable_type_of(const variable* found) {
  return found->group ? found->group->type : VARIABLE_REAL;
}

variable_causality variable_causality_of(const variable* found) {
  return found->group ? found->group->causality : CAUSALITY_PARAMETER;
}

double* variables_real(const variables* v, const variable* found) {
  return (found->group ? v->real[found->id] : v->parameters) + found->index;
}

/* unit, minimum, maximum of an input or parameter */
static tendonfmu_parameter_info range_of(const tendonfmu_finger* finger, const variable* found) {
  tendonfmu_parameter_info info = {0};
  if (found->group) {
    info.minimum = found->group->minimum;
    info.maximum = found->group->maximum;
    info.unit = found->group->unit;
  } else {
    tendonfmu_get_parameter_info(finger, found->index, &info);
  }
  return info;
}

int variables_accept(const tendonfmu_finger* finger, const variable* found, double value) {
  if (found->group) {
    return value >= found->group->minimum && value <= found->group->maximum; /* what is not a number compares false */
  }
  const tendonfmu_parameter_info range = range_of(finger, found);
  return value <= range.maximum && (range.above_minimum ? value > range.minimum : value >= range.minimum);
}

void variables_append_refusal(log_text* text, const tendonfmu_finger* finger, const variable* found, double value) {
  const tendonfmu_parameter_info range = range_of(finger, found);
  variables_append_name(text, finger, found);
  log_append(text, " = ");
  log_append_number(text, value);
  log_append(text, range.above_minimum ? ": expected above " : ": expected ");
  log_append_number(text, range.minimum);
  log_append(text, range.above_minimum ? " and at most " : " to ");
  log_append_number(text, range.maximum);
  log_append(text, " ");
  log_append(text, range.unit);
}

tendonfmu_inputs variables_inputs(const variables* v) {
  return (tendonfmu_inputs){.tendon_force = v->real[GROUP_TENDON_FORCE],
                            .tendon_position = v->real[GROUP_TENDON_POSITION],
                            .joint_position = v->real[GROUP_JOINT_POSITION],
                            .joint_velocity = v->real[GROUP_JOINT_VELOCITY]};
}

tendonfmu_outputs variables_outputs(const variables* v) {
  return (tendonfmu_outputs){.compensated_torque = v->real[GROUP_COMPENSATED_TORQUE],
                             .joint_torque = v->real[GROUP_JOINT_TORQUE],
                             .friction_torque = v->real[GROUP_FRICTION_TORQUE],
                             .bias_torque = v->real[GROUP_BIAS_TORQUE],
                             .joint_angle = v->real[GROUP_JOINT_ANGLE],
                             .joint_speed = v->real[GROUP_JOINT_SPEED],
                             .joint_contact = v->flag[GROUP_JOINT_CONTACT],
                             .contact = v->flag[GROUP_CONTACT],
                             .slack = v->flag[GROUP_SLACK]};
}

void variables_append_name(log_text* text, const tendonfmu_finger* finger, const variable* found) {
  char path[128];
  if (!found->group) {
    if (tendonfmu_get_parameter_path(finger, found->index, path, sizeof path) == TENDONFMU_OK) {
      log_append(text, path);
    }
    return;
  }
  log_append(text, found->group->name);
  if (found->group->size != SIZE_SCALAR) {
    log_append(text, "[");
    log_append_count(text, found->index + 1);
    log_append(text, "]");
  }
}

const char* variable_type_name(variable_type type) {
  static const char* const names[] = {"Real", "Integer", "Boolean", "String"};
  return names[type];
}
