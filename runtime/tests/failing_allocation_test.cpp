// The C interfaces of the estimation without memory: no exception leaves them, and what failed can be done again.
#include <cstdlib>
#include <new>
#include <string_view>

#include "made_recording.h"
#include "tendonfmu_learner.h"

namespace {

thread_local long left = -1;  // allocations that succeed before all others fail; below 0: all succeed

}  // namespace

// not inlined: gcc takes free() beside new for a mistake
__attribute__((noinline)) void* operator new(std::size_t size) {
  if (left == 0) {
    throw std::bad_alloc();
  }
  left -= left > 0;
  if (void* memory = std::malloc(size)) {
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
long failures(const Call& succeeds) {
  for (long enough = 0; enough < 100000; ++enough) {
    left = enough;
    const bool done = succeeds();
    left = -1;
    if (done) {
      return enough;
    }
  }
  return -1;
}

struct FailingAllocation : testing::Test {
  std::vector<unsigned char> image = made::image_of(made::learnable_finger());
  char message[200] = "";
};

TEST_F(FailingAllocation, MakesNothingAndSaysWhy) {
  const auto create = [&](auto call, auto* made, auto... options) {
    bool said = true;
    const long failed = failures([&] {
      *made = call(image.data(), image.size(), nullptr, nullptr, options..., message, sizeof message);
      said = said && (*made || std::string_view(message) == "out of memory");
      return *made != nullptr;
    });
    EXPECT_GT(failed, 5);
    EXPECT_TRUE(said) << message;
  };
  tendonfmu_estimator* estimator = nullptr;
  create(tendonfmu_estimator_create, &estimator);
  tendonfmu_estimator_destroy(estimator);
  tendonfmu_learner* learner = nullptr;
  create(tendonfmu_learner_create, &learner, static_cast<const tendonfmu_learner_options*>(nullptr));
  tendonfmu_learner_destroy(learner);
}

TEST_F(FailingAllocation, LeavesAnEstimatorThatTakesTheSameRecordingLater) {
  const made::Recording recording = made::made(made::learnable_finger(), 50, 0.002, 1);
  tendonfmu_estimator* estimator =
      tendonfmu_estimator_create(image.data(), image.size(), nullptr, nullptr, message, sizeof message);
  ASSERT_TRUE(estimator) << message;
  const tendonfmu_inputs inputs = recording.inputs();
  const long failed = failures([&] {
    return tendonfmu_estimator_add_recording(estimator, recording.time.size(), recording.time.data(), &inputs, 3,
                                             nullptr, nullptr, nullptr) == TENDONFMU_OK;
  });
  EXPECT_GT(failed, 2);
  left = 0;
  tendonfmu_unknown unknown;
  const tendonfmu_status refused = tendonfmu_estimator_get_unknown(estimator, 1 << 20, &unknown);
  left = -1;
  EXPECT_NE(refused, TENDONFMU_OK);
  EXPECT_EQ(tendonfmu_estimator_get_unknown(estimator, 0, &unknown), TENDONFMU_OK);
  tendonfmu_estimator_destroy(estimator);
}

}  // namespace
