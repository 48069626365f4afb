/* Moves the finger through time with CVODE (A. C. Hindmarsh et al., "SUNDIALS: Suite of nonlinear and
 * differential/algebraic equation solvers", ACM TOMS 31(3), 2005): backward differentiation formulas, Newton's
 * matrix from the stiff part of the Jacobian, kinks found as roots. */
#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

#include <exception>
#include <stdexcept>
#include <vector>

#include "dynamics.h"
#include "linearisation.h"

namespace tendonfmu::plant {

/* SUNDIALS 6 and 7 differ in a few names. */
#if SUNDIALS_VERSION_MAJOR >= 7
using solver_number = sunrealtype;
using solver_flag = sunbooleantype;
#else
using solver_number = realtype;
using solver_flag = booleantype;
#endif

/* The integrator gave up: time, cause, what to try. */
struct solver_error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct statistics {
  unsigned long long steps = 0, right_hand_sides = 0, jacobians = 0, roots = 0, restarts = 0;
};

/* A moment of the finger. */
struct moment {
  double time = 0.0;
  std::vector<double> state;
  contact_modes modes;
};

class integrator {
 public:
  /* Throws std::bad_alloc when SUNDIALS runs out of memory. */
  integrator(dynamics* equations, double relative_tolerance);
  ~integrator();
  integrator(const integrator&) = delete;
  integrator& operator=(const integrator&) = delete;

  /* The state or its modes have changed from outside: the next advance begins anew. */
  void forget();

  /* The inputs have changed, which is a jump: the next advance begins anew. With a rough tolerance only if it must: a
   * client that changes inputs once will do so again, so that the last step then ends at the communication point, from
   * which CVODE goes on with the inputs that come next. */
  void change_inputs();

  /* Moves `now` on to time `until`, which is not beyond the next communication point. Throws solver_error and leaves
   * `now` as it was. */
  void advance(const commands& inputs, double until, double communication_point, moment* now);

  const statistics& work() const { return work_; }
  void clear_work() { work_ = {}; }

 private:
  double* data() const { return N_VGetArrayPointer(state_); }
  void allocate();
  void release();
  void set_tolerances();
  void start(double time);
  void set_stop(const commands& inputs);
  void count();
  [[noreturn]] void fail(int flag, double time);

  // what CVODE calls: C, which no exception may pass
  template <class Call>
  int kept(Call call) noexcept;
  static int right_hand_side(solver_number time, N_Vector state, N_Vector derivative, void* data);
  static int root_functions(solver_number time, N_Vector state, solver_number* root, void* data);
  static int prepare(solver_number time, N_Vector state, N_Vector rate, SUNMatrix matrix, solver_flag old_will_do,
                     solver_flag* taken, solver_number gamma, void* data, N_Vector scratch, N_Vector, N_Vector);
  static int solve(SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, solver_number tolerance);

  dynamics& equations_;
  linearisation linearisation_;
  double tolerance_;
  bool rough_;                 /* see set_tolerances() */
  std::vector<double> pushes_; /* s, push_times() */
  SUNContext context_ = nullptr;
  N_Vector state_ = nullptr, tolerances_ = nullptr;
  SUNMatrix matrix_ = nullptr; /* empty: linearisation_ has its content */
  SUNLinearSolver solver_ = nullptr;
  void* cvode_ = nullptr;
  bool fresh_ = true, changed_ = false;
  double stop_; /* s, where no step passes */
  const commands* inputs_ = nullptr;
  contact_modes modes_;
  std::exception_ptr thrown_;
  statistics work_, counted_;
};

}  // namespace tendonfmu::plant
