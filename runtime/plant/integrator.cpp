#include "integrator.h"

#include <cvode/cvode.h>
#include <cvode/cvode_ls.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <utility>

#include "description_error.h"
#include "motion.h"

namespace tendonfmu::plant {
namespace {

constexpr double never = 1e10;            // s
constexpr double longest_step = 0.02;     // s
constexpr double least_steps = 50000;     // for one advance, ...
constexpr double most_frequent = 200000;  // ... and as many more for each of its seconds
constexpr int most_roots_at_once = 10000; /* for one advance: chattering */

/* Absolute tolerances: the relative one times what is small for the quantity. */
constexpr double small_angle = 0.1, small_speed = 1.0;                     // rad, rad/s
constexpr double small_motor = 1e-3, small_motor_speed = 0.1;              // m, m/s
constexpr double small_bristle = 1.0, small_heat = 1.0, small_work = 0.1;  // -, J, J

constexpr double rough_tolerance = 1e-5, rough_speed = 100.0;  // -; rad/s, m/s: see set_tolerances()

/* Whether CVODE refuses to start, since no step fits between two times. */
bool same_moment(double time, double until) {
  return until - time <= 1e-15 + 4.0 * std::numeric_limits<double>::epsilon() * std::fabs(until);
}

/* `time`, a little later: more than CVODE loses in rounding. */
double just_after(double time) {
  return time + 1e-12 * (1.0 + std::fabs(time));
}

}  // namespace

integrator::integrator(dynamics* equations, double relative_tolerance)
    : equations_(*equations),
      linearisation_(equations->the_rig()),
      tolerance_(relative_tolerance),
      rough_(relative_tolerance >= rough_tolerance),
      pushes_(push_times(equations->the_rig())),
      stop_(never) {
  try {
    allocate();
  } catch (...) {
    release();
    throw;
  }
}

integrator::~integrator() {
  release();
}

void integrator::allocate() {
  const auto need = [](bool good) {
    if (!good) {
      throw std::bad_alloc();
    }
  };
#if SUNDIALS_VERSION_MAJOR >= 7
  need(SUNContext_Create(SUN_COMM_NULL, &context_) == 0);
  SUNContext_ClearErrHandlers(context_);  // messages come with the exception; nothing is printed
#else
  need(SUNContext_Create(nullptr, &context_) == 0);
#endif
  const auto size = static_cast<sunindextype>(equations_.layout().size());
  need((state_ = N_VNew_Serial(size, context_)));
  need((tolerances_ = N_VNew_Serial(size, context_)));
  need((matrix_ = SUNMatNewEmpty(context_)));
  need((solver_ = SUNLinSolNewEmpty(context_)));
  need((cvode_ = CVodeCreate(CV_BDF, context_)));
  solver_->content = &linearisation_;
  solver_->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
  solver_->ops->solve = solve;
#if SUNDIALS_VERSION_MAJOR < 7
  CVodeSetErrHandlerFn(
      cvode_, [](int, const char*, const char*, char*, void*) {}, nullptr);
#endif
  set_tolerances();
  N_VConst(0.0, state_);
  need(CVodeInit(cvode_, right_hand_side, 0.0, state_) == CV_SUCCESS);
  need(CVodeSVtolerances(cvode_, tolerance_, tolerances_) == CV_SUCCESS);
  need(CVodeSetUserData(cvode_, this) == CV_SUCCESS);
  need(CVodeSetLinearSolver(cvode_, solver_, matrix_) == CV_SUCCESS);
  need(CVodeSetLinSysFn(cvode_, prepare) == CV_SUCCESS);
  need(CVodeRootInit(cvode_, static_cast<int>(equations_.root_count()), root_functions) == CV_SUCCESS);
  need(CVodeSetMaxOrd(cvode_, rough_ ? 2 : 5) == CV_SUCCESS);
  need(CVodeSetMaxStep(cvode_, longest_step) == CV_SUCCESS);
  need(CVodeSetMaxErrTestFails(cvode_, 15) == CV_SUCCESS);
  CVodeSetNoInactiveRootWarn(cvode_);
}

void integrator::release() {
  CVodeFree(&cvode_);
  SUNLinSolFreeEmpty(solver_);
  SUNMatFreeEmpty(matrix_);
  N_VDestroy(tolerances_);
  N_VDestroy(state_);
  SUNContext_Free(&context_);
}

/* A rough tolerance passes over the vibrations of links on their tendons, which each new input excites: no tolerance on
 * speeds, and order 2, since higher ones are not stable on vibrations. */
void integrator::set_tolerances() {
  const state_layout& at = equations_.layout();
  double* absolute = N_VGetArrayPointer(tolerances_);
  const auto fill = [&](std::size_t first, std::size_t end, double scale) {
    std::fill(absolute + first, absolute + end, tolerance_ * scale);
  };
  fill(at.angle(), at.speed(), small_angle);
  fill(at.speed(), at.motor(), rough_ ? rough_speed : small_speed);
  fill(at.motor(), at.motor_speed(), small_motor);
  fill(at.motor_speed(), at.bristle(), rough_ ? rough_speed : small_motor_speed);
  fill(at.bristle(), at.heat(), small_bristle);
  fill(at.heat(), at.motor_work(), small_heat);
  fill(at.motor_work(), at.size(), small_work);
}

void integrator::forget() {
  fresh_ = true;
  changed_ = false;
  stop_ = never;
}

void integrator::change_inputs() {
  changed_ = rough_;
  fresh_ = fresh_ || !rough_;
}

/* Begins anew at the present content of state_. */
void integrator::start(double time) {
  if (CVodeReInit(cvode_, time, state_) != CV_SUCCESS) {
    throw std::bad_alloc();
  }
  work_.restarts += 1;
  counted_ = {};
  fresh_ = false;
}

/* A finger at rest is integrated in long steps: each must end where a push begins, is full, lets go or ends. */
void integrator::set_stop(const commands& inputs) {
  double stop = stop_, internal = 0.0;
  CVodeGetCurrentTime(cvode_, &internal);
  const auto next = std::upper_bound(pushes_.begin(), pushes_.end(), just_after(internal));
  if (inputs.scheduled_pushes && next != pushes_.end()) {
    stop = std::min(stop, *next);
  }
  CVodeSetStopTime(cvode_, stop);
}

void integrator::advance(const commands& inputs, double until, double communication_point, moment* now) {
  if (until <= now->time) {
    return;
  }
  double reached = now->time;
  if (changed_) {
    double internal = 0.0;
    CVodeGetCurrentTime(cvode_, &internal);
    fresh_ = fresh_ || internal > just_after(now->time);  // it has gone beyond, with the former inputs
    changed_ = false;
    stop_ = communication_point;
  } else if (until > stop_) {
    stop_ = never;
  }
  inputs_ = &inputs;
  modes_ = now->modes;
  if (fresh_) {
    if (same_moment(now->time, until)) {
      now->time = until;
      return;
    }
    std::copy(now->state.begin(), now->state.end(), data());
    start(now->time);
  }
  double left = least_steps + most_frequent * (until - now->time);
  for (int found = 0;;) {
    set_stop(inputs);
    CVodeSetMaxNumSteps(cvode_, static_cast<long>(std::clamp(left, 1.0, 2e9)));
    const unsigned long long steps_before = work_.steps;
    const int flag = CVode(cvode_, until, state_, &reached, CV_NORMAL);
    count();
    left -= static_cast<double>(work_.steps - steps_before);
    if (thrown_) {
      forget();
      std::rethrow_exception(std::exchange(thrown_, nullptr));
    }
    if (flag == CV_TSTOP_RETURN && reached < until) {
      continue;
    }
    if (flag == CV_SUCCESS || flag == CV_TSTOP_RETURN) {
      break;
    }
    if (flag != CV_ROOT_RETURN) {
      fail(flag, reached);
    }
    if (found++ == most_roots_at_once) {
      fail(CV_TOO_MUCH_WORK, reached);
    }
    int signs[max_roots];
    CVodeGetRootInfo(cvode_, signs);
    equations_.switch_modes(signs, &modes_);
    work_.roots += 1;
    start(reached);
    if (same_moment(reached, until)) {
      break;
    }
  }
  std::copy(data(), data() + now->state.size(), now->state.begin());
  now->modes = modes_;
  now->time = until;
}

void integrator::count() {
  long steps = 0, evaluations = 0;
  CVodeGetNumSteps(cvode_, &steps);
  CVodeGetNumRhsEvals(cvode_, &evaluations);
  work_.steps += static_cast<unsigned long long>(steps) - counted_.steps;
  work_.right_hand_sides += static_cast<unsigned long long>(evaluations) - counted_.right_hand_sides;
  counted_.steps = static_cast<unsigned long long>(steps);
  counted_.right_hand_sides = static_cast<unsigned long long>(evaluations);
}

void integrator::fail(int flag, double time) {
  forget();
  const char* cause = "CVODE gave up";
  const char* remedy = "check masses, stiffnesses and the motion for values that are far too large or too small";
  if (flag == CV_TOO_MUCH_WORK) {
    cause = "CVODE took too many steps";
    remedy = "try a larger relative_tolerance; a rig too stiff or chattering does this";
  } else if (flag == CV_TOO_MUCH_ACC) {
    cause = "CVODE cannot reach the tolerance asked for";
    remedy = "try a larger relative_tolerance";
  } else if (flag == CV_ERR_FAILURE || flag == CV_CONV_FAILURE || flag == CV_LSETUP_FAIL) {
    cause =
        flag == CV_ERR_FAILURE ? "CVODE's error test failed too often" : "CVODE's Newton iteration did not converge";
    remedy = "try a larger relative_tolerance, or a rig that is less stiff";
  } else if (flag == CV_RHSFUNC_FAIL || flag == CV_FIRST_RHSFUNC_ERR || flag == CV_REPTD_RHSFUNC_ERR) {
    cause = "the motion diverges";
  }
  throw solver_error(sentence(cause, " at t = ", time, " s (CVODE flag ", flag, "): ", remedy));
}

template <class Call>
int integrator::kept(Call call) noexcept {
  try {
    return call();
  } catch (...) {
    thrown_ = std::current_exception();
    return -1;  // CVODE gives up
  }
}

int integrator::right_hand_side(solver_number time, N_Vector state, N_Vector derivative, void* data) {
  auto* self = static_cast<integrator*>(data);
  return self->kept([&] {
    double* result = N_VGetArrayPointer(derivative);
    self->equations_.want_slopes(false);
    self->equations_.evaluate(time, N_VGetArrayPointer(state), &self->modes_, *self->inputs_, result);
    const std::size_t n = self->equations_.layout().joints;
    // 1: recoverable, CVODE tries a smaller step
    return std::all_of(result, result + 2 * n, [](double x) { return std::fabs(x) < 1e9; }) ? 0 : 1;
  });
}

int integrator::root_functions(solver_number, N_Vector state, solver_number* root, void* data) {
  auto* self = static_cast<integrator*>(data);
  return self->kept([&] {
    self->equations_.roots(N_VGetArrayPointer(state), root);
    // CVODE overlooks a function that is 0 where it starts: a joint at rest on its stop would pass through it. There, 0
    // stands for the side that holds.
    self->equations_.visit_modes(&self->modes_, [root](std::size_t k, bool mode, bool when_positive) {
      if (root[k] == 0.0) {
        root[k] = mode == when_positive ? 1e-100 : -1e-100;
      }
    });
    return 0;
  });
}

int integrator::prepare(solver_number time, N_Vector state, N_Vector, SUNMatrix, solver_flag old_will_do,
                        solver_flag* taken, solver_number gamma, void* data, N_Vector scratch, N_Vector, N_Vector) {
  auto* self = static_cast<integrator*>(data);
  return self->kept([&] {
    if (!old_will_do) {
      const double* y = N_VGetArrayPointer(state);
      self->equations_.want_slopes(true);
      self->equations_.evaluate(time, y, &self->modes_, *self->inputs_, N_VGetArrayPointer(scratch));
      self->linearisation_.take(self->equations_.last(), y);
      self->work_.jacobians += 1;
    }
    *taken = old_will_do ? SUNFALSE : SUNTRUE;
    return self->linearisation_.factor(gamma) ? 0 : 1;
  });
}

int integrator::solve(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, solver_number) {
  const double* right = N_VGetArrayPointer(b);
  double* unknown = N_VGetArrayPointer(x);
  if (unknown != right) {
    std::copy(right, right + N_VGetLength(b), unknown);
  }
  static_cast<const linearisation*>(solver->content)->solve(unknown);
  return 0;
}

}  // namespace tendonfmu::plant
