// The memory of the simulated finger's sensors; what they show: python_tests/simulate/test_plant_sensors.py.
#include "sensor_bank.h"

#include <gtest/gtest.h>

#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;
using test_plant::Json;

rig with_sensors(const Json& sensors) {
  Json text = test_plant::plain(1, 2);
  text["sensors"] = sensors;
  return test_plant::read(text);
}

TEST(SensorBank, ContinuesFromWhatItRemembered) {
  const rig one = with_sensors({{"tendon_position", {{"noise", 0.1}, {"delay", 0.0035}, {"backlash", 0.2}}},
                                {"joint_position", {{"delay", 0.05}, {"resolution", 1e-3}}}});
  readings exact(1, 2);
  const auto feed = [&](sensor_bank* bank, std::uint64_t first, std::uint64_t end) {
    for (std::uint64_t k = first; k < end; ++k) {
      exact.tendon_position[0] = std::sin(0.1 * static_cast<double>(k));
      exact.joint_position[0] = std::cos(0.2 * static_cast<double>(k));
      bank->sample(k, 9, exact);
    }
  };
  const auto memory = [](const sensor_bank& bank) {
    std::vector<double> numbers;
    sensor_bank::visit_state(
        bank, [&](const double* values, std::size_t count) { numbers.insert(numbers.end(), values, values + count); });
    return numbers;
  };
  for (const std::uint64_t stop : {0u, 1u, 2u, 37u, 200u}) {
    sensor_bank straight(one), first(one), second(one);
    feed(&straight, 0, 300);
    feed(&first, 0, stop);
    feed(&second, 0, 11);  // another past, to be forgotten
    const std::vector<double> numbers = memory(first);
    auto next = numbers.begin();
    sensor_bank::visit_state(second, [&](double* values, std::size_t count) {
      std::copy_n(next, count, values);
      next += static_cast<std::ptrdiff_t>(count);
    });
    EXPECT_EQ(next, numbers.end());
    feed(&second, stop, 300);
    EXPECT_EQ(memory(second), memory(straight)) << stop;
    straight.clear();
    feed(&straight, 0, 5);
    sensor_bank fresh(one);
    feed(&fresh, 0, 5);
    EXPECT_EQ(straight.newest().tendon_position, fresh.newest().tendon_position);
    EXPECT_EQ(straight.newest().joint_position, fresh.newest().joint_position);
  }
}

}  // namespace
