// The estimation without memory: nothing is left behind, and what failed can be done again.
#include <cstdlib>
#include <new>

#include "made_recording.h"

namespace {

thread_local long left = -1;  // allocations that succeed before all others fail; below 0: all succeed

}  // namespace

// not inlined: gcc takes free() beside new for a mistake
__attribute__((noinline)) void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  if (left == 0) {
    return nullptr;
  }
  left -= left > 0;
  return std::malloc(size);
}

__attribute__((noinline)) void* operator new(std::size_t size) {
  if (void* memory = operator new(size, std::nothrow)) {
    return memory;
  }
  throw std::bad_alloc();
}

__attribute__((noinline)) void operator delete(void* memory) noexcept {
  std::free(memory);
}

__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

namespace {

/* Calls with memory for 0, 1, 2 ... allocations until the call succeeds; how often it failed. */
template <typename Call>
long failures(const Call& call) {
  for (long enough = 0; enough < 100000; ++enough) {
    left = enough;
    try {
      call();
      left = -1;
      return enough;
    } catch (const std::bad_alloc&) {
      left = -1;
    }
  }
  return -1;
}

TEST(FailingAllocation, ThrowsUntilThereIsEnough) {
  const std::vector<unsigned char> image = made::image_of(made::learnable_finger());
  EXPECT_GT(failures([&] { made::estimator(image.data(), image.size()); }), 5);
  EXPECT_GT(failures([&] { tendonfmu::estimation::make_learner(image.data(), image.size()); }), 5);
}

TEST(FailingAllocation, LeavesAnEstimatorThatTakesTheSameRecordingLater) {
  const made::Recording recording = made::made(made::learnable_finger(), 50, 0.002, 1);
  made::estimator e = made::estimator_of(made::learnable_finger()),
                  untouched = made::estimator_of(made::learnable_finger());
  EXPECT_GT(failures([&] { e.add_recording(recording.arrays()); }), 2);
  untouched.add_recording(recording.arrays());
  EXPECT_EQ(e.evaluate(e.start()).gradient, untouched.evaluate(e.start()).gradient);
}

}  // namespace
