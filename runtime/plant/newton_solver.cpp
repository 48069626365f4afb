#include "newton_solver.h"

#include <sundials/sundials_nvector.h>

#include <algorithm>

namespace tendonfmu::plant {
namespace {

SUNMatrix_ID custom_matrix(SUNMatrix) {
  return SUNMATRIX_CUSTOM;
}
void free_matrix(SUNMatrix matrix) {
  SUNMatFreeEmpty(matrix);
}
int leave_matrix(SUNMatrix) {
  return 0;
}

SUNLinearSolver_Type direct(SUNLinearSolver) {
  return SUNLINEARSOLVER_DIRECT;
}
SUNLinearSolver_ID custom_solver(SUNLinearSolver) {
  return SUNLINEARSOLVER_CUSTOM;
}
int initialise(SUNLinearSolver) {
  return 0;
}
int set_up(SUNLinearSolver, SUNMatrix) {
  return 0;
}

int solve(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, solver_number) {
  const auto* blocks = static_cast<const linearisation*>(solver->content);
  double* unknown = N_VGetArrayPointer(x);
  const double* right = N_VGetArrayPointer(b);
  if (unknown != right) {
    std::copy(right, right + N_VGetLength(b), unknown);
  }
  blocks->solve(unknown);
  return 0;
}

int free_solver(SUNLinearSolver solver) {
  SUNLinSolFreeEmpty(solver);
  return 0;
}

}  // namespace

SUNMatrix newton_matrix(linearisation* blocks, SUNContext context) {
  SUNMatrix matrix = SUNMatNewEmpty(context);
  if (matrix == nullptr) {
    return nullptr;
  }
  matrix->content = blocks;
  matrix->ops->getid = custom_matrix;
  matrix->ops->destroy = free_matrix;
  matrix->ops->zero = leave_matrix;
  return matrix;
}

SUNLinearSolver newton_solver(linearisation* blocks, SUNContext context) {
  SUNLinearSolver solver = SUNLinSolNewEmpty(context);
  if (solver == nullptr) {
    return nullptr;
  }
  solver->content = blocks;
  solver->ops->gettype = direct;
  solver->ops->getid = custom_solver;
  solver->ops->initialize = initialise;
  solver->ops->setup = set_up;
  solver->ops->solve = solve;
  solver->ops->free = free_solver;
  return solver;
}

}  // namespace tendonfmu::plant
