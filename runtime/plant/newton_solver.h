/* `linearisation` as a SUNDIALS matrix and linear solver. */
#ifndef TENDONFMU_PLANT_NEWTON_SOLVER_H
#define TENDONFMU_PLANT_NEWTON_SOLVER_H

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

#endif
