// Time of a step of the C interface: bench_step [OPTIONS OF GOOGLE BENCHMARK] FILE.json ... (bench_case.h). Counter
// per_step is the figure of docs/evidence/speed.md.
#include <benchmark/benchmark.h>

#include <memory>

#include "bench_case.h"

namespace {

using finger_pointer = std::unique_ptr<tendonfmu_finger, decltype(&tendonfmu_destroy)>;

finger_pointer finger_of(const bench_case& made) {
  return {tendonfmu_create(made.image.data(), made.image.size(), nullptr, 0), &tendonfmu_destroy};
}

// Steps one by one, as a control loop does.
void run(tendonfmu_finger* finger, const bench_case& made) {
  std::vector<double> torque(tendonfmu_joint_count(finger));
  tendonfmu_outputs outputs = {};
  outputs.compensated_torque = torque.data();
  tendonfmu_reset(finger);
  for (std::size_t k = 0; k < made.samples; ++k) {
    const tendonfmu_inputs inputs = made.inputs(k);
    if (k == 0) {
      tendonfmu_initialise(finger, made.time[k], &inputs);
    } else {
      tendonfmu_step(finger, made.time[k], &inputs);
    }
    tendonfmu_get_outputs(finger, &outputs);
    benchmark::DoNotOptimize(torque.data());
  }
}

void steps(benchmark::State& state, const bench_case& made, const char* kernel) {
  const finger_pointer finger = finger_of(made);
  if (tendonfmu_set_kernel(finger.get(), kernel) != TENDONFMU_OK) {
    state.SkipWithError("this kernel cannot run here");
    return;
  }
  for (auto _ : state) {
    run(finger.get(), made);
  }
  const auto count = static_cast<double>(state.iterations() * static_cast<std::int64_t>(made.samples));
  state.counters["per_step"] = benchmark::Counter(count, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (int k = 1; k < argc; ++k) {
    const std::filesystem::path file = argv[k];
    const auto made = std::make_shared<const bench_case>(read_case(file));
    for (const char* kernel : {"avx2", "sse2", "plain"}) {
      const std::string name = std::string(kernel) + "/" + file.stem().string();
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { steps(state, *made, kernel); });
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
