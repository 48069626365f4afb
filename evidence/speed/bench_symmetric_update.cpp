// Speed of the estimation's products on every implementation that runs here, and on Eigen as this program is compiled,
// in GFLOP/s: two for each product that enters the result (of add_outer_products: its lower triangle; of
// multiply_symmetric: the columns that are not zero).
#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <random>
#include <string>
#include <vector>

#include "symmetric_update.h"

namespace {

using tendonfmu::estimation::symmetric_update;

std::vector<double> numbers(std::size_t count) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> all(count);
  for (double& x : all) {
    x = normal(random);
  }
  return all;
}

void count(benchmark::State* state, double flops) {
  using counter = benchmark::Counter;
  state->counters["GFLOP/s"] = counter(1e-9 * flops * static_cast<double>(state->iterations()), counter::kIsRate);
}

using eigen_matrix = Eigen::Map<Eigen::MatrixXd>;
using eigen_columns = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;  // a row of ours is a column here

Eigen::Index as_index(std::size_t size) {
  return static_cast<Eigen::Index>(size);
}

void eigen_outer_products(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride,
                          double factor) {
  const eigen_columns given(rows, as_index(p), as_index(k), Eigen::OuterStride<>(as_index(stride)));
  eigen_matrix(lower, as_index(p), as_index(p)).selfadjointView<Eigen::Lower>().rankUpdate(given, factor);
}

void eigen_symmetric(double* product, std::size_t, const double* lower, std::size_t p, const double* rows,
                     std::size_t k, std::size_t stride) {
  const eigen_columns given(rows, as_index(p), as_index(k), Eigen::OuterStride<>(as_index(stride)));
  const Eigen::Map<const Eigen::MatrixXd> matrix(lower, as_index(p), as_index(p));
  eigen_matrix(product, as_index(p), as_index(k)).noalias() = matrix.selfadjointView<Eigen::Lower>() * given;
}

const symmetric_update eigen = {"eigen", eigen_outer_products, eigen_symmetric, nullptr, nullptr};

void add_outer_products(benchmark::State& state, const symmetric_update* kernel) {
  const auto p = static_cast<std::size_t>(state.range(0)), k = static_cast<std::size_t>(state.range(1));
  const std::vector<double> rows = numbers(k * p);
  std::vector<double> lower = numbers(p * p);
  for (auto _ : state) {
    kernel->add_outer_products(lower.data(), p, rows.data(), k, p, -1e-9);
  }
  count(&state, static_cast<double>(p * (p + 1) * k));
}

// 2 columns of 5 are not zero, as in an index finger's samples
void multiply_symmetric(benchmark::State& state, const symmetric_update* kernel) {
  const auto p = static_cast<std::size_t>(state.range(0)), k = static_cast<std::size_t>(state.range(1));
  std::vector<double> rows = numbers(k * p), product(k * p);
  const std::vector<double> lower = numbers(p * p);
  std::size_t columns = 0;
  for (std::size_t i = 0; i < p; ++i) {
    columns += i % 5 < 2;
    for (std::size_t r = 0; i % 5 >= 2 && r < k; ++r) {
      rows[r * p + i] = 0.0;
    }
  }
  for (auto _ : state) {
    kernel->multiply_symmetric(product.data(), p, lower.data(), p, rows.data(), k, p);
  }
  count(&state, 2.0 * static_cast<double>(p * columns * k));
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::vector<std::int64_t>> sizes = {{240, 476}, {4, 32, 128}};
  const auto add = [&sizes](const symmetric_update* kernel) {
    const std::string name = kernel->name;
    benchmark::RegisterBenchmark((name + "/add_outer_products").c_str(), add_outer_products, kernel)
        ->ArgsProduct(sizes);
    benchmark::RegisterBenchmark((name + "/multiply_symmetric").c_str(), multiply_symmetric, kernel)
        ->ArgsProduct(sizes);
  };
  for (const symmetric_update* kernel = tendonfmu::estimation::symmetric_updates(); kernel->name; ++kernel) {
    add(kernel);
  }
  add(&eigen);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
