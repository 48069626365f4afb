/* Tried by Sundials.cmake: CVODE as the simulated finger uses it can be linked into a shared library, without MPI. */
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_linearsolver.h>

#ifndef SUNDIALS_DOUBLE_PRECISION
#error "SUNDIALS was built for another precision than double"
#endif

#if SUNDIALS_VERSION_MAJOR >= 7
#define NO_COMMUNICATOR SUN_COMM_NULL
typedef sunrealtype real_number;
#else
#define NO_COMMUNICATOR NULL
typedef realtype real_number;
#endif

static int derivative(real_number time, N_Vector state, N_Vector slope, void* data) {
  (void)time;
  (void)data;
  N_VScale(-1.0, state, slope);
  return 0;
}

static int root(real_number time, N_Vector state, real_number* value, void* data) {
  (void)time;
  (void)data;
  value[0] = N_VGetArrayPointer(state)[0] - 0.5;
  return 0;
}

int tendonfmu_sundials_check(void);

int tendonfmu_sundials_check(void) {
  SUNContext context;
  N_Vector state;
  void* solver;
  SUNLinearSolver linear_solver;
  real_number time = 0.0;
  if (SUNContext_Create(NO_COMMUNICATOR, &context) != 0) {
    return 1;
  }
  state = N_VNew_Serial(1, context);
  solver = CVodeCreate(CV_BDF, context);
  linear_solver = SUNLinSolNewEmpty(context);
  if (CVodeInit(solver, derivative, 0.0, state) != CV_SUCCESS || CVodeRootInit(solver, 1, root) != CV_SUCCESS ||
      CVodeSStolerances(solver, 1e-6, 1e-9) != CV_SUCCESS ||
      CVodeSetLinearSolver(solver, linear_solver, NULL) != CV_SUCCESS ||
      CVode(solver, 1.0, state, &time, CV_NORMAL) < 0) {
    return 2;
  }
  SUNLinSolFreeEmpty(linear_solver);
  CVodeFree(&solver);
  N_VDestroy(state);
  return SUNContext_Free(&context);
}

int main(void) {
  return tendonfmu_sundials_check();
}
