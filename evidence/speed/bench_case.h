// A finger and its samples, as `python -m evidence speed.steps` writes them: NAME.image, and NAME.samples with doubles,
// row by row: time, force of each tendon, position of each tendon.
#pragma once

#include <benchmark/benchmark.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <vector>

#include "tendonfmu.h"

using finger_pointer = std::unique_ptr<tendonfmu_finger, decltype(&tendonfmu_destroy)>;

struct bench_case {
  std::vector<char> image;
  std::size_t tendons = 0, samples = 0;
  std::vector<double> time, input;  // a sample of input: forces, positions

  explicit bench_case(std::filesystem::path file) {
    std::ifstream stored(file, std::ios::binary);
    image.assign(std::istreambuf_iterator<char>(stored), {});
    tendons = tendonfmu_tendon_count(finger().get());
    std::ifstream rows(file.replace_extension(".samples"), std::ios::binary);
    std::vector<double> row(1 + 2 * tendons);
    while (rows.read(reinterpret_cast<char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(double)))) {
      time.push_back(row[0]);
      input.insert(input.end(), row.begin() + 1, row.end());
    }
    samples = time.size();
  }

  finger_pointer finger() const {
    return {tendonfmu_create(image.data(), image.size(), nullptr, 0), &tendonfmu_destroy};
  }
  const double* inputs(std::size_t sample) const { return &input[sample * 2 * tendons]; }
};

// Counter per_step, s: the figure of docs/evidence/speed.md.
inline void count_steps(benchmark::State& state, const bench_case& made) {
  const auto count = static_cast<double>(state.iterations() * static_cast<std::int64_t>(made.samples));
  state.counters["per_step"] = benchmark::Counter(count, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
