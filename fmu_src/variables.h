/* The variables of one FMU by value reference: where their numbers live and what they are called. */
#pragma once

#include <stddef.h>

#include "log.h"
#include "model.h"
#include "variable_table.h"

/* All memory is taken by variables_create(). */
typedef struct variables {
  size_t parameter_count;           /* p */
  int arrays;                       /* a value reference stands for a whole group, not for one element */
  double* numbers;                  /* one block: what the pointers below point into */
  double* derivatives;              /* [input_count + output_count] room for a second layout of these */
  unsigned char* flags;             /* likewise */
  size_t count[GROUP_COUNT];        /* elements of each group; 0 where the model does not have what it needs */
  size_t number_count;              /* of the block, without the derivatives */
  size_t input_count, output_count; /* inputs stand first in the block, then Real and Integer outputs, then settings */
  double* number[GROUP_COUNT];      /* inputs, Real and Integer outputs, and parameters, by group; NULL for others */
  unsigned char* flag[GROUP_COUNT]; /* Boolean outputs by group, NULL for others */
  double* parameters;               /* [p] by path, as the importer set them; the model may not have them yet */
  double* time;                     /* s, end of the last step: the independent variable of FMI 3.0 */
  int parameters_pending;           /* they may differ from those of the model */
} variables;

/* One variable, found by its value reference. */
typedef struct variable {
  const variable_group* group; /* NULL: a parameter by path, or behind all of them the independent variable */
  variable_group_id id;        /* of the group */
  size_t index;                /* from 0, in the group or among the parameters */
  int whole;                   /* all elements of the group from `index` on */
} variable;

/* 0, or -1 when memory is out; then variables_destroy() is still to be called. */
int variables_create(variables* v, const model* m, int arrays);
void variables_destroy(variables* v);

/* Inputs to 0, outputs to 0, settings and parameters to those of the model. */
void variables_start(variables* v, const model* m);

void variables_clear_outputs(variables* v);

/* Settings to those of the model. */
void variables_fetch_settings(variables* v, const model* m);

/* 0 when there is such a variable. */
static inline int variables_find(const variables* v, unsigned value_reference, variable* found) {
  if (value_reference >= VARIABLE_PARAMETER_BASE) {
    *found = (variable){NULL, GROUP_COUNT, value_reference - VARIABLE_PARAMETER_BASE, 0};
    return found->index < v->parameter_count ? 0 : -1;
  }
  if (v->arrays && value_reference == VARIABLE_TIME_REFERENCE) {
    *found = (variable){NULL, GROUP_COUNT, v->parameter_count, 0};
    return 0;
  }
  const variable_group_id id = value_reference < VARIABLE_GROUP_END
                                   ? (variable_group_id)variable_group_at[value_reference / VARIABLE_GROUP_SPACING]
                                   : GROUP_COUNT;
  const size_t index = value_reference % VARIABLE_GROUP_SPACING;
  if (id == GROUP_COUNT || index >= v->count[id] || (v->arrays && index)) {
    return -1;
  }
  const variable_group* group = &variable_groups[id];
  *found = (variable){group, id, index, v->arrays && group->size != SIZE_SCALAR};
  return 0;
}

/* Numbers that the variable has: those of its group when it is whole, otherwise 1. */
static inline size_t variables_extent(const variables* v, const variable* found) {
  return found->whole ? v->count[found->id] : 1;
}

/* Element i of a variable, a variable by itself. */
static inline variable variables_element(const variable* whole, size_t i) {
  return (variable){whole->group, whole->id, whole->index + i, 0};
}

static inline variable_type variable_type_of(const variable* found) {
  return found->group ? found->group->type : VARIABLE_REAL;
}

static inline variable_causality variable_causality_of(const variable* found) {
  return found->group ? found->group->causality : CAUSALITY_PARAMETER;
}

/* Boolean outputs live in flags, all others in the block of numbers. */
static inline int variable_is_flag(const variable* found) {
  return variable_type_of(found) == VARIABLE_BOOLEAN && variable_causality_of(found) == CAUSALITY_OUTPUT;
}

/* Where the number lives. Not for Boolean outputs. */
static inline double* variables_number(const variables* v, const variable* found) {
  return (found->group ? v->number[found->id] : v->parameters) + found->index;
}

/* The same as a place in the block of numbers; Boolean outputs stand in flags, whose places are those behind it. */
static inline size_t variables_place(const variables* v, const variable* found) {
  return variable_is_flag(found) ? v->number_count + (size_t)(v->flag[found->id] - v->flags) + found->index
                                 : (size_t)(variables_number(v, found) - v->numbers);
}

/* 1 when the variable may have the value, whatever the others have; what is not a number compares false. */
int variables_accept(const model* m, const variable* found, double value);

/* "<name> = <value>: expected <range> <unit>" */
log_text variables_refusal(const model* m, const variable* found, double value);

/* Name as in the XML, such as "tendon_force[2]" or "contact"; of a whole group "tendon_force". */
log_text variables_name(const model* m, const variable* found);
