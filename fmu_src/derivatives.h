/* Partial derivatives of the model's outputs by its inputs, of the sample last taken. */
#pragma once

#include "component.h"

typedef struct references {
  const unsigned* references; /* [count] value references */
  size_t count;
} references;

/* Elements of arrays stand in the order of their index. */
typedef struct partials {
  references unknowns, knowns;
  const double* seed;  /* [seed_count] */
  double* sensitivity; /* [sensitivity_count] */
  size_t seed_count, sensitivity_count;
} partials;

/* sensitivity of the unknowns = J times the seed of the knowns. */
fmu_status derivatives_directional(component* c, const partials* p);

/* sensitivity of the knowns = transposed J times the seed of the unknowns. */
fmu_status derivatives_adjoint(component* c, const partials* p);
