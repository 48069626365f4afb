// Sensors of the simulated finger, one effect at a time, and their memory.
#include "sensor_bank.h"

#include <gtest/gtest.h>

#include "random_numbers.h"
#include "test_plant.h"

namespace {

using namespace tendonfmu::plant;
using test_plant::Json;

rig with_sensors(const Json& sensors) {
  Json text = test_plant::plain(1, 2);
  text["sensors"] = sensors;
  return test_plant::read(text);
}

/* What tendon_position[1] shows for a series of true values. */
std::vector<double> shown(const rig& rig, const std::vector<double>& truth) {
  sensor_bank bank(rig);
  std::vector<double> found;
  readings exact(1, 2);
  for (std::size_t k = 0; k < truth.size(); ++k) {
    exact.tendon_position[0] = truth[k];
    bank.sample(k, 5, exact);
    found.push_back(bank.newest().tendon_position[0]);
  }
  return found;
}

TEST(SensorBank, DelaysByWholeAndPartSamples) {
  const std::vector<double> truth = {1, 2, 4, 8, 16, 32, 64};
  const auto delayed = [&](double delay) {
    return shown(with_sensors({{"rate", 100}, {"tendon_position", {{"delay", delay}}}}), truth);
  };
  EXPECT_EQ(delayed(0.02), (std::vector<double>{1, 1, 1, 2, 4, 8, 16}));
  const std::vector<double> between = delayed(0.025), expected = {1, 1, 1, 1.5, 3, 6, 12};
  for (std::size_t k = 0; k < truth.size(); ++k) {
    EXPECT_NEAR(between[k], expected[k], 1e-12) << k;
  }
  const std::vector<double> little = delayed(0.001);
  EXPECT_NEAR(little[1], 1.9, 1e-12);
}

TEST(SensorBank, BacklashFollowsOnceTheGapIsTakenUp) {
  const rig play = with_sensors({{"tendon_position", {{"backlash", 0.5}}}});
  EXPECT_EQ(shown(play, {10, 10.125, 10.5, 11.25, 11, 10.75, 10.25, 9.75, 9.875, 10.5}),
            (std::vector<double>{10, 10, 10.25, 11, 11, 11, 10.5, 10, 10, 10.25}));
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
