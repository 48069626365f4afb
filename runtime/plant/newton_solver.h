/* `linearisation` as a SUNDIALS matrix and linear solver. */
#pragma once

#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

#include "linearisation.h"
#include "sundials_version.h"

namespace tendonfmu::plant {

/* Both refer to `linearisation`, which must outlive them; nullptr when memory is out. The matrix is I − γ J as
 * linearisation::factor() has prepared it, the solver calls linearisation::solve(). */
SUNMatrix newton_matrix(linearisation* blocks, SUNContext context);
SUNLinearSolver newton_solver(linearisation* blocks, SUNContext context);

}  // namespace tendonfmu::plant
