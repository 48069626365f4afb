// A step must allocate nothing, make no system call and leave the host as it was: counted on the release build.
#include <fenv.h>
#include <gtest/gtest.h>
#include <locale.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "allocation_count.h"
#include "test_finger.h"

#if defined(__linux__)
#include <linux/seccomp.h>
#include <pthread.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

using test_finger::Finger;
using test_finger::Motion;
using test_finger::Outputs;

namespace {

using test_finger::image_of;
enum { FINGERS = test_finger::kinds };

/* with a force that fails now and then */
Motion failing_motion(std::size_t samples) {
  Motion motion(samples);
  motion.let_force_fail(1);
  return motion;
}

/* everything that the header promises to be fit for real time; returns how many calls did not answer as they should */
int exercise(tendonfmu_finger* finger, const tendonfmu_finger* spare, const Motion& motion,
             const tendonfmu_outputs& view, std::vector<unsigned char>& state) {
  int wrong = 0;
  const std::size_t samples = motion.time.size();
  tendonfmu_inputs inputs = motion.row(0);
  std::size_t done = 0;
  double value = 0.0;
  wrong += tendonfmu_initialise(finger, motion.time[0], &inputs) != TENDONFMU_OK;
  for (std::size_t k = 1; k < samples / 2; ++k) {
    inputs = motion.row(k);
    wrong += tendonfmu_step(finger, motion.time[k], &inputs) != TENDONFMU_OK;
    wrong += tendonfmu_get_outputs(finger, &view) != TENDONFMU_OK;
  }
  inputs = motion.row(samples / 2);
  wrong += tendonfmu_run(finger, samples / 2, &motion.time[samples / 2], &inputs, &view, &done) != TENDONFMU_OK;
  wrong += tendonfmu_get_directional_derivative(finger, &inputs, &view) != TENDONFMU_OK;
  wrong += tendonfmu_step_hand(1, &finger, motion.time.back() + 1e-3, &inputs, &view, nullptr) != TENDONFMU_OK;
  wrong += tendonfmu_take_parameters(finger, spare) != TENDONFMU_OK;
  wrong += tendonfmu_save_state(finger, state.data(), state.size()) != TENDONFMU_OK;
  wrong += tendonfmu_set_parameter(finger, "joints[1].friction.static", 0.0041) != TENDONFMU_OK;
  wrong += tendonfmu_get_parameter(finger, "contact.threshold[2]", &value) != TENDONFMU_OK;
  wrong += tendonfmu_restore_state(finger, state.data(), state.size()) != TENDONFMU_OK;
  wrong += tendonfmu_reset(finger) != TENDONFMU_OK;
  return wrong;
}

TEST(QuietStep, AllocatesNothing) {
#if !defined(COUNTS_ALLOCATIONS)
  GTEST_SKIP() << "SKIPPED: malloc can only be counted with glibc and without sanitizers";
#else
  const Motion motion = failing_motion(20000);
  const std::vector<const char*> kernels = test_finger::kernels();
  for (std::size_t k = 0; k < kernels.size() * FINGERS; ++k) {
    const Finger finger(image_of(static_cast<int>(k % FINGERS))), spare(image_of(static_cast<int>(k % FINGERS)));
    tendonfmu_set_kernel(finger, kernels[k / FINGERS]);
    Outputs outputs(motion.time.size());
    const tendonfmu_outputs view = outputs.view();
    std::vector<unsigned char> state(tendonfmu_state_size(finger));
    ASSERT_TRUE(allocations_count());
    count_allocations_anew();
    const int wrong = exercise(finger, spare, motion, view, state);
    const long counted = counted_allocations();
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(counted, 0) << kernels[k / FINGERS];
  }
#endif
}

#if defined(__linux__) && !defined(UNDER_SANITIZER)

/* Runs in a child that the kernel kills at its first system call other than exit; a lock that blocks would be one. */
template <typename Action>
int exit_status_without_system_calls(Action action) {
  const pid_t child = fork();
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
      _exit(77);
    }
    const int result = action();
    syscall(SYS_exit, result);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

TEST(QuietStep, MakesNoSystemCall) {
  const Motion motion = failing_motion(20000);
  const int caught = exit_status_without_system_calls([] { return getppid() > 0 ? 0 : 1; });
  if (caught == 77) {
    GTEST_SKIP() << "SKIPPED: this kernel has no seccomp";
  }
  ASSERT_EQ(caught, -SIGKILL) << "a system call went unnoticed";
  for (int which = 0; which < FINGERS; ++which) {
    const Finger finger(image_of(which)), spare(image_of(which));
    Outputs outputs(motion.time.size());
    const tendonfmu_outputs view = outputs.view();
    std::vector<unsigned char> state(tendonfmu_state_size(finger));
    EXPECT_EQ(exit_status_without_system_calls([&] { return exercise(finger, spare, motion, view, state); }), 0);
  }
}

#endif

#if defined(__linux__) && !defined(UNDER_SANITIZER) && defined(__OPTIMIZE__)

/* bytes of stack that a thread has touched for an action */
template <typename Action>
std::size_t stack_of_thread(Action action) {
  const std::size_t size = 1 << 20;
  const auto untouched = static_cast<unsigned char>(0xa5);
  void* stack = std::aligned_alloc(4096, size);
  std::memset(stack, untouched, size);
  pthread_attr_t attributes;
  pthread_t thread;
  pthread_attr_init(&attributes);
  pthread_attr_setstack(&attributes, stack, size);
  const auto run = [](void* given) -> void* {
    (*static_cast<Action*>(given))();
    return nullptr;
  };
  EXPECT_EQ(pthread_create(&thread, &attributes, run, &action), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
  const auto* byte = static_cast<const unsigned char*>(stack);
  const std::size_t left =
      static_cast<std::size_t>(std::find_if(byte, byte + size, [&](auto b) { return b != untouched; }) - byte);
  std::free(stack);
  return size - left;
}

/* what tendonfmu.h promises of all calls but creation, reset, and those that change moment arms */
TEST(QuietStep, UsesLessThanEightKiBOfStack) {
  const Motion motion = failing_motion(200);
  const std::size_t at_rest = stack_of_thread([] {});
  ASSERT_GT(stack_of_thread([] {
              volatile char block[5000];
              block[0] = block[4999] = 1;
            }),
            at_rest + 4000)
      << "the use of stack goes unnoticed";
  for (int k = 0; k < 2 * FINGERS; ++k) {
    Finger finger(image_of(k % FINGERS));
    if (k >= FINGERS) {
      ASSERT_EQ(tendonfmu_set_kernel(finger, "plain"), TENDONFMU_OK);
    }
    Outputs outputs(motion.time.size());
    std::vector<unsigned char> state(tendonfmu_state_size(finger));
    const tendonfmu_outputs view = outputs.view();
    const tendonfmu_inputs inputs = motion.row(0);
    std::vector<double> wrong(tendonfmu_tendon_count(finger), 1.2345678901234567e200);
    tendonfmu_inputs refused = inputs;
    refused.tendon_force = wrong.data();
    std::size_t done = 0;
    double value = 0.0;
    const std::pair<const char*, std::function<tendonfmu_status()>> calls[] = {
        {"initialise", [&] { return tendonfmu_initialise(finger, motion.time[0], &inputs); }},
        {"step", [&] { return tendonfmu_step(finger, motion.time[1], &inputs); }},
        {"refused step", [&] { return tendonfmu_step(finger, motion.time[2], &refused); }},
        {"run", [&] { return tendonfmu_run(finger, 150, &motion.time[2], &inputs, &view, &done); }},
        {"get_outputs", [&] { return tendonfmu_get_outputs(finger, &view); }},
        {"get_directional_derivative", [&] { return tendonfmu_get_directional_derivative(finger, &inputs, &view); }},
        {"set_parameter", [&] { return tendonfmu_set_parameter(finger, "joints[1].friction.static", 0.0041); }},
        {"get_parameter", [&] { return tendonfmu_get_parameter(finger, "contact.threshold[2]", &value); }},
        {"save_state", [&] { return tendonfmu_save_state(finger, state.data(), state.size()); }},
        {"restore_state", [&] { return tendonfmu_restore_state(finger, state.data(), state.size()); }},
    };
    for (const auto& [name, call] : calls) {
      tendonfmu_status status = TENDONFMU_OK;
      const std::size_t used = stack_of_thread([&] { status = call(); }) - at_rest;
      EXPECT_EQ(status == TENDONFMU_OK, std::string(name) != "refused step") << name;
      EXPECT_LT(used, 8192u) << name << ", finger " << k;
      RecordProperty(name, std::to_string(used));
    }
  }
}

#endif

TEST(QuietStep, LeavesTheHostAsItWas) {
  const Motion motion = failing_motion(2000);
  const Finger finger(image_of(FINGERS - 1)), spare(image_of(FINGERS - 1));
  Outputs outputs(motion.time.size());
  const tendonfmu_outputs view = outputs.view();
  std::vector<unsigned char> state(tendonfmu_state_size(finger));
  fenv_t before, after;
  fegetenv(&before);
  feclearexcept(FE_ALL_EXCEPT);
  const int rounding = fegetround();
  const std::string locale = setlocale(LC_ALL, nullptr);
  struct sigaction handler_before = {}, handler_after = {};
  sigaction(SIGFPE, nullptr, &handler_before);
  EXPECT_EQ(exercise(finger, spare, motion, view, state), 0);
  EXPECT_EQ(fegetround(), rounding);
  EXPECT_EQ(fetestexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW), 0);
  EXPECT_EQ(setlocale(LC_ALL, nullptr), locale);
  sigaction(SIGFPE, nullptr, &handler_after);
  EXPECT_EQ(handler_before.sa_handler, handler_after.sa_handler);
  fegetenv(&after);
#if defined(__x86_64__) && defined(__GLIBC__)
  const unsigned control = 0xffc0u; /* rounding, masks, flush to zero, denormals are zero */
  EXPECT_EQ(before.__mxcsr & control, after.__mxcsr & control);
#endif
  /* denormals still work */
  volatile double tiny = 1e-310;
  EXPECT_GT(tiny / 2.0, 0.0);
}

}  // namespace
