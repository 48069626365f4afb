#include "cvode_integrator.h"

#include <cvode/cvode.h>
#include <cvode/cvode_ls.h>
#include <nvector/nvector_serial.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <string>
#include <utility>

#include "elementary.h"
#include "linearisation.h"
#include "newton_solver.h"
#include "sentence.h"
#include "sundials_version.h"

/* The linker gives this to CVODE for pow() (cmake/Sundials.cmake), which takes its step sizes by it: the same bits on
 * every machine of one architecture. CVODE's bases are not negative. It stands here, and in no file of its own, so that
 * it is there before the archives of SUNDIALS ask for it. */
// NOLINTNEXTLINE(readability-identifier-naming): the name that the linker asks for
extern "C" double __wrap_pow(double base, double exponent);
extern "C" double __wrap_pow(double base, double exponent) {
  if (base != base) {
    return base;
  }
  if (base <= 0.0) {
    return exponent == 0.0 ? 1.0 : 0.0;
  }
  if (std::isinf(base)) {
    return exponent > 0.0 ? base : 0.0;
  }
  return tendonfmu::plant::exponential(exponent * tendonfmu::plant::logarithm(base));
}

namespace tendonfmu::plant {
namespace {

constexpr double longest_step = 0.02;     // s
constexpr double least_steps = 50000;     // for one advance, ...
constexpr double most_frequent = 200000;  // ... and as many more for each of its seconds
constexpr int most_roots_at_once = 10000; /* for one advance: chattering */

/* Absolute tolerances: the relative one times what is small for the quantity. */
constexpr double small_angle = 0.1, small_speed = 1.0;                     // rad, rad/s
constexpr double small_motor = 1e-3, small_motor_speed = 0.1;              // m, m/s
constexpr double small_bristle = 1.0, small_heat = 1.0, small_work = 0.1;  // -, J, J

class cvode_integrator : public integrator {
 public:
  cvode_integrator(dynamics* equations, double relative_tolerance)
      : equations_(*equations),
        linearisation_(equations->the_rig()),
        tolerance_(relative_tolerance),
        stops_(push_times(equations->the_rig())) {
    if (create_context(&context_) != 0) {
      throw std::bad_alloc();
    }
    const auto size = static_cast<sunindextype>(equations->layout().size());
    state_ = N_VNew_Serial(size, context_);
    tolerances_ = N_VNew_Serial(size, context_);
    matrix_ = newton_matrix(&linearisation_, context_);
    solver_ = newton_solver(&linearisation_, context_);
    cvode_ = CVodeCreate(CV_BDF, context_);
    if (!state_ || !tolerances_ || !matrix_ || !solver_ || !cvode_) {
      release();
      throw std::bad_alloc();
    }
    silence();
    set_tolerances();
  }

  ~cvode_integrator() override { release(); }
  cvode_integrator(const cvode_integrator&) = delete;
  cvode_integrator& operator=(const cvode_integrator&) = delete;

  void forget() override { fresh_ = true; }

  void advance(const commands& inputs, double until, moment* now) override {
    if (until <= now->time) {
      return;
    }
    inputs_ = &inputs;
    modes_ = now->modes;
    if (fresh_) {
      if (same_moment(now->time, until)) {  // where CVODE refuses to start
        now->time = until;
        return;
      }
      std::copy(now->state.begin(), now->state.end(), data());
      start(now->time);
    }
    double reached = now->time;
    double left = least_steps + most_frequent * (until - now->time);
    for (int found = 0;;) {
      if (inputs.scheduled_pushes) {
        stop_at_next_push();
      }
      CVodeSetMaxNumSteps(cvode_, static_cast<long>(std::clamp(left, 1.0, 2e9)));
      const unsigned long long steps_before = work_.steps;
      const int flag = CVode(cvode_, until, state_, &reached, CV_NORMAL);
      count();
      left -= static_cast<double>(work_.steps - steps_before);
      if (thrown_) {
        fresh_ = true;
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

 private:
  double* data() const { return N_VGetArrayPointer(state_); }

  void set_tolerances() {
    const state_layout& at = equations_.layout();
    double* absolute = N_VGetArrayPointer(tolerances_);
    const auto fill = [&](std::size_t first, std::size_t end, double scale) {
      std::fill(absolute + first, absolute + end, tolerance_ * scale);
    };
    fill(at.angle(), at.speed(), small_angle);
    fill(at.speed(), at.motor(), small_speed);
    fill(at.motor(), at.motor_speed(), small_motor);
    fill(at.motor_speed(), at.bristle(), small_motor_speed);
    fill(at.bristle(), at.heat(), small_bristle);
    fill(at.heat(), at.motor_work(), small_heat);
    fill(at.motor_work(), at.size(), small_work);
  }

  /* Begins, or begins anew, at the present content of state_. */
  void start(double time) {
    if (!created_) {
      bool good = CVodeInit(cvode_, right_hand_side, time, state_) == CV_SUCCESS;
      good = good && CVodeSVtolerances(cvode_, tolerance_, tolerances_) == CV_SUCCESS;
      good = good && CVodeSetUserData(cvode_, this) == CV_SUCCESS;
      good = good && CVodeSetLinearSolver(cvode_, solver_, matrix_) == CV_SUCCESS;
      good = good && CVodeSetLinSysFn(cvode_, prepare) == CV_SUCCESS;
      good = good && CVodeRootInit(cvode_, static_cast<int>(equations_.root_count()), root_functions) == CV_SUCCESS;
      good = good && CVodeSetMaxStep(cvode_, longest_step) == CV_SUCCESS;
      good = good && CVodeSetMaxErrTestFails(cvode_, 15) == CV_SUCCESS;
      CVodeSetNoInactiveRootWarn(cvode_);
      if (!good) {
        throw std::bad_alloc();
      }
      created_ = true;
    } else {
      if (CVodeReInit(cvode_, time, state_) != CV_SUCCESS) {
        throw std::bad_alloc();
      }
      work_.restarts += 1;
    }
    counted_ = {};
    fresh_ = false;
  }

  /* A finger at rest is integrated in long steps: each must end where a push begins, is full, lets go or ends. */
  void stop_at_next_push() {
    double internal = 0.0;
    CVodeGetCurrentTime(cvode_, &internal);
    const auto next = std::upper_bound(stops_.begin(), stops_.end(), internal + 1e-12 * (1.0 + std::fabs(internal)));
    if (next != stops_.end()) {
      CVodeSetStopTime(cvode_, *next);
    }
  }

  /* Messages come with the exception; nothing is printed. */
  void silence() {
#if SUNDIALS_VERSION_MAJOR >= 7
    SUNContext_ClearErrHandlers(context_);
#else
    CVodeSetErrHandlerFn(
        cvode_, [](int, const char*, const char*, char*, void*) {}, nullptr);
#endif
  }

  void count() {
    long steps = 0, evaluations = 0;
    CVodeGetNumSteps(cvode_, &steps);
    CVodeGetNumRhsEvals(cvode_, &evaluations);
    work_.steps += static_cast<unsigned long long>(steps) - counted_.steps;
    work_.right_hand_sides += static_cast<unsigned long long>(evaluations) - counted_.right_hand_sides;
    counted_.steps = static_cast<unsigned long long>(steps);
    counted_.right_hand_sides = static_cast<unsigned long long>(evaluations);
  }

  [[noreturn]] void fail(int flag, double time) {
    fresh_ = true;
    const char* cause = "CVODE gave up";
    const char* remedy = "check masses, stiffnesses and the motion for values that are far too large or too small";
    if (flag == CV_TOO_MUCH_WORK) {
      cause = "CVODE took too many steps";
      remedy = "try a larger relative_tolerance or the fixed-step integrator; a rig too stiff or chattering does this";
    } else if (flag == CV_TOO_MUCH_ACC) {
      cause = "CVODE cannot reach the tolerance asked for";
      remedy = "try a larger relative_tolerance";
    } else if (flag == CV_ERR_FAILURE || flag == CV_CONV_FAILURE || flag == CV_LSETUP_FAIL) {
      cause =
          flag == CV_ERR_FAILURE ? "CVODE's error test failed too often" : "CVODE's Newton iteration did not converge";
      remedy = "try a larger relative_tolerance or the fixed-step integrator, or a rig that is less stiff";
    } else if (flag == CV_RHSFUNC_FAIL || flag == CV_FIRST_RHSFUNC_ERR || flag == CV_REPTD_RHSFUNC_ERR) {
      cause = "the motion diverges";
    }
    throw solver_error(sentence(cause, " at t = ", time, " s (CVODE flag ", flag, "): ", remedy));
  }

  void release() {
    if (cvode_) {
      CVodeFree(&cvode_);
    }
    if (solver_) {
      SUNLinSolFree(solver_);
    }
    if (matrix_) {
      SUNMatDestroy(matrix_);
    }
    if (tolerances_) {
      N_VDestroy(tolerances_);
    }
    if (state_) {
      N_VDestroy(state_);
    }
    if (context_) {
      SUNContext_Free(&context_);
    }
  }

  // --- what CVODE calls: C, which no exception may pass ---

  template <class Call>
  int kept(Call call) noexcept {
    try {
      return call();
    } catch (...) {
      thrown_ = std::current_exception();
      return -1;  // CVODE gives up
    }
  }

  static int right_hand_side(solver_number time, N_Vector state, N_Vector derivative, void* data) {
    auto* self = static_cast<cvode_integrator*>(data);
    return self->kept([&] {
      double* result = N_VGetArrayPointer(derivative);
      self->equations_.want_slopes(false);
      self->equations_.evaluate(time, N_VGetArrayPointer(state), &self->modes_, *self->inputs_, result);
      const std::size_t n = self->equations_.layout().joints;
      // 1: recoverable, CVODE tries a smaller step
      return std::all_of(result, result + 2 * n, [](double x) { return std::fabs(x) < 1e9; }) ? 0 : 1;
    });
  }

  static int root_functions(solver_number, N_Vector state, solver_number* root, void* data) {
    auto* self = static_cast<cvode_integrator*>(data);
    return self->kept([&] {
      self->equations_.roots(N_VGetArrayPointer(state), root);
      self->avoid_zeros(root);
      return 0;
    });
  }

  /* CVODE overlooks a function that is 0 where it starts: a joint at rest on its stop would pass through it. There, 0
   * stands for the side that holds. */
  void avoid_zeros(double* root) const {
    const auto hold = [&root](bool positive) {
      if (*root == 0.0) {
        *root = positive ? 1e-100 : -1e-100;
      }
      ++root;
    };
    const state_layout& at = equations_.layout();
    for (std::size_t i = 0; i < at.tendons; ++i) {
      hold(!modes_.slack[i]);
    }
    for (std::size_t j = 0; j < at.joints; ++j) {
      hold(modes_.below[j]);
      hold(modes_.above[j]);
    }
    if (equations_.the_rig().obstacle.present) {
      hold(modes_.touching);
    }
  }

  static int prepare(solver_number time, N_Vector state, N_Vector, SUNMatrix, solver_flag old_will_do,
                     solver_flag* taken, solver_number gamma, void* data, N_Vector scratch, N_Vector, N_Vector) {
    auto* self = static_cast<cvode_integrator*>(data);
    return self->kept([&] {
      if (!old_will_do) {
        const double* y = N_VGetArrayPointer(state);
        self->equations_.want_slopes(true);
        self->equations_.evaluate(time, y, &self->modes_, *self->inputs_, N_VGetArrayPointer(scratch));
        self->linearisation_.take(self->equations_, y, *self->inputs_, rigid_slopes::exact);
        self->work_.jacobians += 1;
      }
      *taken = old_will_do ? SUNFALSE : SUNTRUE;
      return self->linearisation_.factor(gamma) ? 0 : 1;
    });
  }

  dynamics& equations_;
  linearisation linearisation_;
  double tolerance_;
  std::vector<double> stops_; /* s, see stop_at_next_push() */
  SUNContext context_ = nullptr;
  N_Vector state_ = nullptr, tolerances_ = nullptr;
  SUNMatrix matrix_ = nullptr;
  SUNLinearSolver solver_ = nullptr;
  void* cvode_ = nullptr;
  bool created_ = false, fresh_ = true;
  const commands* inputs_ = nullptr;
  contact_modes modes_;
  std::exception_ptr thrown_;
  statistics counted_;
};

}  // namespace

std::unique_ptr<integrator> make_cvode_integrator(dynamics* equations, double relative_tolerance) {
  return std::make_unique<cvode_integrator>(equations, relative_tolerance);
}

}  // namespace tendonfmu::plant
