// Time of a step of the C interface: bench_step [OPTIONS OF GOOGLE BENCHMARK] FILE.image ... (bench_case.h).
#include <algorithm>
#include <chrono>
#include <thread>

#include "bench_case.h"

namespace {

// Steps one by one, as a control loop does; after_step(k) follows each.
template <typename After>
void run(tendonfmu_finger* finger, const bench_case& made, After after_step) {
  std::vector<double> torque(tendonfmu_joint_count(finger));
  tendonfmu_outputs outputs = {};
  outputs.compensated_torque = torque.data();
  tendonfmu_reset(finger);
  for (std::size_t k = 0; k < made.samples; ++k) {
    const double* row = made.inputs(k);
    const tendonfmu_inputs inputs = {row, row + made.tendons, nullptr, nullptr};
    if (k == 0) {
      tendonfmu_initialise(finger, made.time[k], &inputs);
    } else {
      tendonfmu_step(finger, made.time[k], &inputs);
    }
    tendonfmu_get_outputs(finger, &outputs);
    benchmark::DoNotOptimize(torque.data());
    after_step(k);
  }
}

void steps(benchmark::State& state, const bench_case& made, const char* kernel) {
  const finger_pointer finger = made.finger();
  if (tendonfmu_set_kernel(finger.get(), kernel) != TENDONFMU_OK) {
    state.SkipWithError("this kernel cannot run here");
    return;
  }
  for (auto _ : state) {
    run(finger.get(), made, [](std::size_t) {});
  }
  count_steps(state, made);
}

// A million steps, each timed by the clock on the wall: the median, the largest of 10,000, the largest of all; and the
// sample that takes longest even in its fastest round, which is the work of a step without what else the machine does.
void million(benchmark::State& state, const bench_case& made) {
  using clock = std::chrono::steady_clock;
  const finger_pointer finger = made.finger();
  std::vector<double> all, least(made.samples, 1.0);
  for (auto _ : state) {
    while (all.size() < 1000000) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1)); /* Linux stops a real-time thread that never rests */
      clock::time_point begin = clock::now();
      run(finger.get(), made, [&](std::size_t k) {
        const clock::time_point end = clock::now();
        all.push_back(std::chrono::duration<double>(end - begin).count());
        least[k] = std::min(least[k], all.back());
        begin = clock::now();
      });
    }
  }
  std::sort(all.begin(), all.end());
  state.counters["median"] = all[all.size() / 2];
  state.counters["one_in_10000"] = all[all.size() - all.size() / 10000];
  state.counters["worst"] = all.back();
  state.counters["slowest_sample"] = *std::max_element(least.begin() + 1, least.end());
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (int k = 1; k < argc; ++k) {
    const std::filesystem::path file = argv[k];
    const auto made = std::make_shared<const bench_case>(file);
    for (const char* kernel : {"avx2", "sse2", "plain"}) {
      const std::string name = std::string(kernel) + "/" + file.stem().string();
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { steps(state, *made, kernel); });
    }
  }
  for (int k = 1; k < argc; ++k) {
    const std::filesystem::path file = argv[k];
    const auto made = std::make_shared<const bench_case>(file);
    const std::string name = "million/" + file.stem().string();
    benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { million(state, *made); })->Iterations(1);
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
