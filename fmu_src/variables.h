/* The variables of one finger by value reference: where their numbers live and what they are called. */
#ifndef TENDONFMU_VARIABLES_H
#define TENDONFMU_VARIABLES_H

#include <stddef.h>

#include "log.h"
#include "tendonfmu.h"
#include "variable_table.h"

/* Arrays of n joints, m tendons, p parameters. All memory is taken by variables_create(). */
typedef struct variables {
  size_t joints, tendons, parameter_count;
  double* numbers;                  /* one block: what the pointers below point into */
  unsigned char* flags;             /* likewise */
  size_t input_count, output_count; /* Real inputs stand first in the block, then Real outputs */
  double* real[GROUP_COUNT];        /* Real inputs and outputs by group, NULL for others */
  unsigned char* flag[GROUP_COUNT]; /* Boolean outputs by group, NULL for others */
  double* parameters;               /* [p] as the importer wants them; the finger may not have them yet */
} variables;

/* One variable, found by its value reference. */
typedef struct variable {
  const variable_group* group; /* NULL: a parameter */
  variable_group_id id;        /* of the group */
  size_t index;                /* from 0, in the group or among the parameters */
} variable;

/* 0, or -1 when memory is out; then variables_destroy() is still to be called. */
int variables_create(variables* v, const tendonfmu_finger* finger);
void variables_destroy(variables* v);

/* Inputs to 0, outputs to 0, parameters to those of the finger. */
void variables_start(variables* v, const tendonfmu_finger* finger);

/* Elements of a group in this finger. */
size_t variables_group_count(const variables* v, const variable_group* group);

/* 0 when there is such a variable. `last` is the one found before, or zeros: neighbours are found fast. */
int variables_find(const variables* v, unsigned value_reference, variable* last);

variable_type variable_type_of(const variable* found);
variable_causality variable_causality_of(const variable* found);

/* Where the Real value lives. Only for variables of type Real. */
double* variables_real(const variables* v, const variable* found);

/* 1 when the Real variable may have the value, whatever the others have. */
int variables_accept(const tendonfmu_finger* finger, const variable* found, double value);

/* Appends "<name> = <value>: expected <range> <unit>". */
void variables_append_refusal(log_text* text, const tendonfmu_finger* finger, const variable* found, double value);

/* Views of the blocks for tendonfmu.h. */
tendonfmu_inputs variables_inputs(const variables* v);
tendonfmu_outputs variables_outputs(const variables* v);

/* Name as in the XML, such as "tendon_force[2]" or "contact". */
void variables_append_name(log_text* text, const tendonfmu_finger* finger, const variable* found);
const char* variable_type_name(variable_type type);

#endif
