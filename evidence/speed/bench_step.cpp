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

void save_and_restore(benchmark::State& state, const bench_case& made) {
  const finger_pointer finger = finger_of(made);
  run(finger.get(), made);
  std::vector<unsigned char> bytes(tendonfmu_state_size(finger.get()));
  for (auto _ : state) {
    tendonfmu_save_state(finger.get(), bytes.data(), bytes.size());
    tendonfmu_restore_state(finger.get(), bytes.data(), bytes.size());
  }
}

void write_a_parameter(benchmark::State& state, const bench_case& made) {
  const finger_pointer finger = finger_of(made);
  const std::size_t index = tendonfmu_find_parameter(finger.get(), "joints[1].friction.static");
  double value = 0.01;
  for (auto _ : state) {
    value = value < 0.02 ? value + 1e-6 : 0.01;
    tendonfmu_set_parameters(finger.get(), 1, &index, &value);
  }
}

void directional_derivative(benchmark::State& state, const bench_case& made) {
  const finger_pointer finger = finger_of(made);
  run(finger.get(), made);
  std::vector<double> slope(tendonfmu_joint_count(finger.get()));
  tendonfmu_outputs derivative = {};
  derivative.compensated_torque = slope.data();
  const tendonfmu_inputs direction = made.inputs(0);
  for (auto _ : state) {
    tendonfmu_get_directional_derivative(finger.get(), &direction, &derivative);
    benchmark::DoNotOptimize(slope.data());
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (int k = 1; k < argc; ++k) {
    const std::filesystem::path file = argv[k];
    const auto made = std::make_shared<const bench_case>(read_case(file));
    const std::string name = file.stem().string();
    const auto add = [&](const std::string& what, auto measure) {
      benchmark::RegisterBenchmark((what + "/" + name).c_str(), [=](benchmark::State& s) { measure(s, *made); });
    };
    for (const char* kernel : {"avx2", "sse2", "plain"}) {
      add(kernel, [kernel](benchmark::State& state, const bench_case& one) { steps(state, one, kernel); });
    }
    add("save_and_restore", save_and_restore);
    add("write_a_parameter", write_a_parameter);
    add("directional_derivative", directional_derivative);
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
