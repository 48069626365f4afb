// Time of a step of the C interface, by kernel and size, and of the same step through tendonfmu.hpp. Counter per_step
// is the figure of docs/evidence/performance.md.
#include <benchmark/benchmark.h>

#include <vector>

#include "bench_finger.h"
#include "tendonfmu.hpp"

namespace {

using bench_finger::key_choice;

constexpr std::size_t samples = 20000;

// A finger with room for its outputs that runs over a recording again and again.
class finger_runner {
 public:
  finger_runner(int joints, int tendons, int points, const char* kernel, key_choice keys = key_choice::paper)
      : image_(bench_finger::image(bench_finger::description(joints, tendons, points, keys))) {
    char message[400];
    finger_ = tendonfmu_create(image_.data(), image_.size(), message, sizeof message);
    usable_ = tendonfmu_set_kernel(finger_, kernel) == TENDONFMU_OK;
    torque_.resize(static_cast<std::size_t>(joints));
  }
  ~finger_runner() { tendonfmu_destroy(finger_); }
  finger_runner(const finger_runner&) = delete;
  finger_runner& operator=(const finger_runner&) = delete;

  bool usable() const { return usable_; }
  tendonfmu_finger* finger() { return finger_; }

  // steps one by one, as a control loop does
  void run(const bench_finger::made_recording& r) {
    const std::size_t m = tendonfmu_tendon_count(finger_);
    tendonfmu_outputs outputs = {};
    outputs.compensated_torque = torque_.data();
    tendonfmu_reset(finger_);
    for (std::size_t k = 0; k < r.time.size(); ++k) {
      const tendonfmu_inputs inputs = {&r.force[k * m], &r.position[k * m], nullptr, nullptr};
      if (k == 0) {
        tendonfmu_initialise(finger_, r.time[k], &inputs);
      } else {
        tendonfmu_step(finger_, r.time[k], &inputs);
      }
      tendonfmu_get_outputs(finger_, &outputs);
      benchmark::DoNotOptimize(torque_.data());
    }
  }

 private:
  std::vector<unsigned char> image_;
  tendonfmu_finger* finger_ = nullptr;
  bool usable_ = false;
  std::vector<double> torque_;
};

void steps(benchmark::State& state, const char* kernel, int joints, int tendons, int points, bool shaking,
           key_choice keys) {
  finger_runner runner(joints, tendons, points, kernel, keys);
  if (!runner.usable()) {
    state.SkipWithError("this kernel cannot run here");
    return;
  }
  const bench_finger::made_recording recording =
      shaking ? bench_finger::shaking(joints, tendons, samples) : bench_finger::motion(joints, tendons, samples);
  for (auto _ : state) {
    runner.run(recording);
  }
  state.counters["per_step"] = benchmark::Counter(static_cast<double>(state.iterations()) * samples,
                                                  benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

// name, kernel, joints, tendons, points, shaking, keys
const auto* const registered = [] {
  const auto add = [](const char* name, const char* kernel, int joints, int tendons, int points, bool shaking,
                      key_choice keys = key_choice::paper) {
    return benchmark::RegisterBenchmark(
               name, [=](benchmark::State& state) { steps(state, kernel, joints, tendons, points, shaking, keys); })
        ->Unit(benchmark::kMillisecond);
  };
  add("step/avx2/4x8x5", "avx2", 4, 8, 5, false);
  add("step/avx2/4x8x5/innovation", "avx2", 4, 8, 5, false, key_choice::innovation);
  add("step/avx2/4x8x5/calibrated", "avx2", 4, 8, 5, false, key_choice::calibrated);
  add("step/avx2/4x8x5/calibrated_presliding", "avx2", 4, 8, 5, false, key_choice::calibrated_presliding);
  add("step/avx2/4x8x5/everything", "avx2", 4, 8, 5, false, key_choice::everything);
  add("step/plain/4x8x5/innovation", "plain", 4, 8, 5, false, key_choice::innovation);
  add("step/avx2/4x8x5/shaking/everything", "avx2", 4, 8, 5, true, key_choice::everything);
  add("step/avx2/4x8x5/torques", "avx2", 4, 8, 5, false, key_choice::torques);
  add("step/avx2/4x8x5/presliding", "avx2", 4, 8, 5, false, key_choice::presliding);
  add("step/avx2/4x8x5/filtered", "avx2", 4, 8, 5, false, key_choice::filtered);
  add("step/avx2/4x8x5/presliding_filtered", "avx2", 4, 8, 5, false, key_choice::presliding_filtered);
  add("step/avx2/4x8x5/delay", "avx2", 4, 8, 5, false, key_choice::delay);
  add("step/sse2/4x8x5", "sse2", 4, 8, 5, false);
  add("step/plain/4x8x5", "plain", 4, 8, 5, false);
  add("step/avx2/4x8x5/shaking", "avx2", 4, 8, 5, true);
  add("step/avx2/1x2x1", "avx2", 1, 2, 1, false);
  return add("step/avx2/16x64x5", "avx2", 16, 64, 5, false);
}();

// The finger of step/avx2/4x8x5, through tendonfmu.hpp.
void cpp_steps(benchmark::State& state) {
  constexpr std::size_t m = 8;
  tendonfmu::finger finger(bench_finger::image(bench_finger::description(4, 8, 5)));
  if (finger.set_kernel("avx2") != tendonfmu::status::ok) {
    state.SkipWithError("this kernel cannot run here");
    return;
  }
  const bench_finger::made_recording r = bench_finger::motion(4, 8, samples);
  std::vector<double> torque(4);
  tendonfmu::outputs outputs;
  outputs.compensated_torque = torque;
  bool well = true;
  for (auto _ : state) {
    well = finger.reset() == tendonfmu::status::ok && well;
    for (std::size_t k = 0; k < samples; ++k) {
      const tendonfmu::inputs inputs = {{&r.force[k * m], m}, {&r.position[k * m], m}};
      well =
          (k == 0 ? finger.initialise(r.time[k], inputs) : finger.step(r.time[k], inputs)) == tendonfmu::status::ok &&
          finger.get_outputs(outputs) == tendonfmu::status::ok && well;
      benchmark::DoNotOptimize(torque.data());
    }
  }
  if (!well) {
    state.SkipWithError("a sample was refused");
  }
  state.counters["per_step"] = benchmark::Counter(static_cast<double>(state.iterations()) * samples,
                                                  benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(cpp_steps)->Name("step/cpp/4x8x5")->Unit(benchmark::kMillisecond);

void save_and_restore(benchmark::State& state) {
  finger_runner runner(4, 8, 5, "auto");
  runner.run(bench_finger::motion(4, 8, 100));
  std::vector<unsigned char> bytes(tendonfmu_state_size(runner.finger()));
  for (auto _ : state) {
    tendonfmu_save_state(runner.finger(), bytes.data(), bytes.size());
    tendonfmu_restore_state(runner.finger(), bytes.data(), bytes.size());
  }
}
BENCHMARK(save_and_restore)->Unit(benchmark::kMicrosecond);

void write_a_parameter(benchmark::State& state) {
  finger_runner runner(4, 8, 5, "auto");
  const std::size_t index = tendonfmu_find_parameter(runner.finger(), "joints[1].friction.static");
  double value = 0.01;
  for (auto _ : state) {
    value = value < 0.02 ? value + 1e-6 : 0.01;
    tendonfmu_set_parameters(runner.finger(), 1, &index, &value);
  }
}
BENCHMARK(write_a_parameter)->Unit(benchmark::kMicrosecond);

void one_directional_derivative(benchmark::State& state) {
  finger_runner runner(4, 8, 5, "auto");
  const bench_finger::made_recording recording = bench_finger::motion(4, 8, 100);
  runner.run(recording);
  double slope[4];
  tendonfmu_outputs derivative = {};
  derivative.compensated_torque = slope;
  const tendonfmu_inputs direction = recording.inputs();
  for (auto _ : state) {
    tendonfmu_get_directional_derivative(runner.finger(), &direction, &derivative);
    benchmark::DoNotOptimize(slope);
  }
}
BENCHMARK(one_directional_derivative)->Unit(benchmark::kMicrosecond);

}  // namespace
