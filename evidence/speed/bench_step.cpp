// Time of a step of the C interface: bench_step [OPTIONS OF GOOGLE BENCHMARK] FILE.image ... (bench_case.h).
#include "bench_case.h"

namespace {

// Steps one by one, as a control loop does.
void run(tendonfmu_finger* finger, const bench_case& made) {
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
  }
}

void steps(benchmark::State& state, const bench_case& made, const char* kernel) {
  const finger_pointer finger = made.finger();
  if (tendonfmu_set_kernel(finger.get(), kernel) != TENDONFMU_OK) {
    state.SkipWithError("this kernel cannot run here");
    return;
  }
  for (auto _ : state) {
    run(finger.get(), made);
  }
  count_steps(state, made);
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
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
