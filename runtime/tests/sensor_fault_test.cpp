// Sensors that fail: what the keys are, kernels, saved states, damaged ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "model_inside.h"

using test_finger::Finger;
using test_finger::joints;
using test_finger::Motion;
using test_finger::tendons;

namespace {

constexpr std::size_t samples = 4000, fails = 1; /* tendon 2 */

const std::vector<unsigned char>& image() {
  static const std::vector<unsigned char> bytes = test_finger::image(test_finger::watched_sensors());
  return bytes;
}

Motion failing() {
  Motion motion(samples);
  motion.let_force_fail(fails);
  return motion;
}

struct Watched {
  test_finger::Outputs usual{samples};
  std::vector<unsigned char> fault = std::vector<unsigned char>(samples * tendons, 9);
  std::vector<unsigned char> observable = std::vector<unsigned char>(samples, 9);

  bool operator==(const Watched& o) const { return usual == o.usual && fault == o.fault && observable == o.observable; }
};

Watched run(tendonfmu_finger* finger, const Motion& motion) {
  Watched found;
  tendonfmu_outputs view = found.usual.view();
  view.sensor_fault = found.fault.data();
  view.contact_observable = found.observable.data();
  const tendonfmu_inputs inputs = motion.all();
  EXPECT_EQ(tendonfmu_run(finger, samples, motion.time.data(), &inputs, &view, nullptr), TENDONFMU_OK)
      << tendonfmu_last_error(finger);
  return found;
}

TEST(SensorFault, IsReportedAtTheTendonAlone) {
  Finger finger(image());
  const Watched found = run(finger.handle, failing());
  for (std::size_t k = 0; k < samples; ++k) {
    EXPECT_EQ(found.fault[k * tendons] + found.fault[k * tendons + 2], 0) << k;
  }
  EXPECT_EQ(found.fault[1000 * tendons + fails], 0);
  EXPECT_EQ(found.fault[1001 * tendons + fails], 1);
  EXPECT_EQ(found.observable[1200], 0);
  EXPECT_EQ(found.fault[1500 * tendons + fails], 0) << "it has recovered";
  EXPECT_EQ(found.observable[1500], 1);
}

TEST(SensorFault, SoundSensorsHaveNoneWithPushesAndAWireThatPushes) {
  Finger finger(image());
  const Watched found = run(finger.handle, Motion(samples));
  EXPECT_EQ(std::count(found.fault.begin(), found.fault.end(), 0), static_cast<long>(samples * tendons));
  EXPECT_EQ(std::count(found.observable.begin(), found.observable.end(), 1), static_cast<long>(samples));
}

TEST(SensorFault, OutputsAreZeroWithoutTheKey) {
  Finger finger(test_finger::image(test_finger::every_key()));
  const Watched found = run(finger.handle, failing());
  EXPECT_EQ(tendonfmu_watches_sensors(finger.handle), 0);
  EXPECT_EQ(std::count(found.fault.begin(), found.fault.end(), 0), static_cast<long>(samples * tendons));
  EXPECT_EQ(std::count(found.observable.begin(), found.observable.end(), 0), static_cast<long>(samples));
}

TEST(SensorFault, AllKernelsGiveTheSameBits) {
  Finger plain(image());
  ASSERT_EQ(tendonfmu_set_kernel(plain.handle, "plain"), TENDONFMU_OK);
  const Watched expected = run(plain.handle, failing());
  for (const char* kernel : {"sse2", "avx2"}) {
    Finger other(image());
    if (tendonfmu_set_kernel(other.handle, kernel) != TENDONFMU_OK) {
      continue;
    }
    EXPECT_TRUE(run(other.handle, failing()) == expected) << kernel;
  }
}

TEST(SensorFault, DefaultsAndPathsOfTheKeys) {
  std::string text = test_finger::json;
  const std::string name = "\"name\": \"test\",";
  Finger finger(test_finger::image(text.insert(text.find(name), "\"sensor_fault\": {}, ")));
  const std::vector<std::pair<std::string, double>> defaults = {{"hold_time", 0.05},
                                                                {"force_resolution", 0.01},
                                                                {"position_resolution", 2e-6},
                                                                {"jump_margin", 1.0},
                                                                {"recovery_time", 0.5}};
  for (const auto& [key, expected] : defaults) {
    double value = -1.0;
    EXPECT_EQ(tendonfmu_get_parameter(finger.handle, ("sensor_fault." + key).c_str(), &value), TENDONFMU_OK) << key;
    EXPECT_EQ(value, expected) << key;
  }
  EXPECT_EQ(tendonfmu_set_parameter(finger.handle, "sensor_fault.jump_margin", 0.0), TENDONFMU_BAD_PARAMETER);
}

TEST(SensorFault, ARowLeavesAndComesBackExactly) {
  Finger finger(image());
  const std::vector<double> whole(finger.handle->derived.inverse_routing,
                                  finger.handle->derived.inverse_routing + joints * finger.handle->tendon_lanes);
  const double* inverse = finger.handle->scratch.inverse_routing;
  double fault[4] = {0.0, FORCE_FAILS, 0.0, 0.0};
  use_rows(finger.handle, fault);
  EXPECT_EQ(finger.handle->scratch.angles_determined, 1);
  for (std::size_t j = 0; j < joints; ++j) {
    for (std::size_t k = 0; k < joints; ++k) { /* R⁺ R = 1 without that row */
      double product = 0.0;
      for (std::size_t i = 0; i < tendons; ++i) {
        const std::size_t lanes = finger.handle->tendon_lanes;
        product += inverse[j * lanes + i] * finger.handle->derived.moment_arm[k * lanes + i];
      }
      EXPECT_NEAR(product, j == k ? 1.0 : 0.0, 1e-12);
    }
    EXPECT_EQ(inverse[j * finger.handle->tendon_lanes + fails], 0.0);
  }
  fault[0] = POSITION_FAILS; /* both of a pair */
  use_rows(finger.handle, fault);
  EXPECT_EQ(finger.handle->scratch.angles_determined, 0);
  recall_rows(finger.handle);
  EXPECT_TRUE(std::equal(whole.begin(), whole.end(), inverse));
}

TEST(SensorFault, ASavedStateWithWhatCannotBeIsRefused) {
  Finger finger(image());
  const Motion motion = failing();
  run(finger.handle, motion);
  const std::size_t row = static_cast<std::size_t>(finger.handle->remembered.sensor - finger.handle->state);
  const std::size_t watch = static_cast<std::size_t>(finger.handle->remembered.watch - finger.handle->state);
  const std::size_t lanes = finger.handle->tendon_lanes;
  const std::vector<std::pair<std::size_t, double>> damages = {
      {row + SENSOR_FAULT * lanes, 3.0},
      {row + SENSOR_FAULT * lanes + 3, 1.0},
      {row + SENSOR_KNOWN * lanes, 0.5},
      {row + SENSOR_FAULT_SINCE * lanes, 1e16},
      {row + SENSOR_TAUT_FORCE * lanes, std::numeric_limits<double>::quiet_NaN()},
      {watch, 3.0},
      {STATE_UNWELL, 2.0}};
  for (const auto& [at, value] : damages) {
    const double before = finger.handle->state[at];
    std::vector<unsigned char> bytes(tendonfmu_state_size(finger.handle));
    finger.handle->state[at] = value;
    ASSERT_EQ(tendonfmu_save_state(finger.handle, bytes.data(), bytes.size()), TENDONFMU_OK);
    finger.handle->state[at] = before;
    EXPECT_EQ(tendonfmu_restore_state(finger.handle, bytes.data(), bytes.size()), TENDONFMU_BAD_STATE) << at;
  }
}

}  // namespace
