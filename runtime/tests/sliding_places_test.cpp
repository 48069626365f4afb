// What the kernels make of places that slide at all times, four at a time, is what each row makes of them by itself.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "model_inside.h"
#include "presliding_step.h"
#include "test_finger.h"

namespace {

using test_finger::Finger;
using test_finger::Motion;

const char* const kernels[] = {"plain", "sse2", "avx2"};

std::vector<unsigned char> image_with(const std::string& rows, const std::string& filter = "") {
  std::string text = test_finger::json;
  const std::string list = "\"extensions\": [", name = "\"name\": \"test\",";
  text.erase(text.find(list));
  text.insert(text.find(name) + name.size(), filter);
  return test_finger::image(text + list + rows + "]}");
}

std::vector<const extension_row*> sliding_rows(const tendonfmu_finger* finger) {
  std::vector<const extension_row*> rows;
  for (std::size_t r = 0; r < finger->extensions.friction; ++r) {
    const extension_row* row = finger->extensions.row + finger->extensions.signals + r;
    if (row->effect->slides) {
      rows.push_back(row);
    }
  }
  return rows;
}

// runs over the motion; after each sample every row remembers what its own advance() says, to the bit
void expect_own_memory(const std::vector<unsigned char>& image, const char* kernel, int source) {
  SCOPED_TRACE(std::string(kernel) + ", source " + std::to_string(source));
  Finger finger(image);
  if (tendonfmu_set_kernel(finger, kernel) != TENDONFMU_OK) {
    GTEST_LOG_(INFO) << "skipped: this machine has no " << kernel << " kernel";
    return;
  }
  tendonfmu_set_kinematics_source(finger, source);
  const auto rows = sliding_rows(finger);
  ASSERT_FALSE(rows.empty());
  const Motion motion(400);
  bool slid = false;
  for (std::size_t k = 0; k < 400; ++k) {
    std::vector<std::vector<double>> before;
    for (const extension_row* row : rows) {
      before.emplace_back(row->memory, row->memory + row->memory_count);
    }
    const tendonfmu_inputs inputs = motion.row(k);
    ASSERT_EQ(k == 0 ? tendonfmu_initialise(finger, motion.time[k], &inputs)
                     : tendonfmu_step(finger, motion.time[k], &inputs),
              TENDONFMU_OK);
    for (std::size_t r = 0; r < rows.size(); ++r) {
      std::vector<double> after(before[r].size());
      rows[r]->effect->advance(rows[r]->place, rows[r]->parameters, &finger.handle->scratch.sample, before[r].data(),
                               after.data());
      ASSERT_EQ(std::memcmp(after.data(), rows[r]->memory, after.size() * sizeof(double)), 0)
          << "sample " << k << ", row " << r;
      slid |= after[0] != 0.0;
    }
    for (std::size_t slot = 0; slot < finger.handle->slots && finger.handle->extensions.only_slides; ++slot) {
      if (finger.handle->scratch.slides[slot] == 0.0) {
        ASSERT_EQ(finger.handle->scratch.grip[slot], 1.0) << "sample " << k << ", beside what slides: slot " << slot;
      }
    }
  }
  EXPECT_TRUE(slid);
}

void expect_own_memory_everywhere(const std::vector<unsigned char>& image) {
  for (const char* kernel : kernels) {
    for (int source = 1; source <= 3; ++source) {
      expect_own_memory(image, kernel, source);
    }
  }
}

TEST(SlidingPlaces, OfOneRowEverywhere) {
  expect_own_memory_everywhere(image_with(R"({"effect": "presliding", "displacement": 0.05})"));
}

TEST(SlidingPlaces, OfRowsThatNameThem) {
  expect_own_memory_everywhere(image_with(R"({"effect": "presliding", "joint": 2, "displacement": 0.02},
    {"effect": "gravity", "joint": 1, "sine": 0.02}, {"effect": "inertia", "joint": 1, "inertia": 1e-5},
    {"effect": "presliding", "tendon": 1, "displacement": 1e-4})"));
}

// the row everywhere goes on remembering the places that it leaves to the other one
TEST(SlidingPlaces, OfARowEverywhereAndOneThatNamesItsPlace) {
  expect_own_memory_everywhere(image_with(R"({"effect": "presliding", "tendon": 2, "displacement": 3e-4},
    {"effect": "friction_drift", "amplitude": 0.3, "time_constant": 2},
    {"effect": "presliding", "displacement": 0.05}, {"effect": "presliding", "joint": 1, "displacement": 0.02})"));
}

TEST(SlidingPlaces, ByThePositionFilter) {
  expect_own_memory_everywhere(image_with(R"({"effect": "presliding", "displacement": 0.05})",
                                          R"("position_filter": {"noise": [2e-4, 3e-4], "jerk_density": 1e4},)"));
}

// what no description says, but an image can: two rows at one place, which is in no layer twice
TEST(SlidingPlaces, OfTwoRowsAtOnePlace) {
  const std::string rows = R"({"effect": "presliding", "tendon": 1, "displacement": 1e-4},
    {"effect": "presliding", "tendon": 2, "displacement": 3e-4})";
  auto image = image_with(rows);
  const Model model(image);
  unsigned char* second = image.data() + MODEL_HEADER_BYTES + 4 * model.shape.word_count + 4 * MODEL_EXTENSION_WORDS;
  ASSERT_EQ(load_u32(second + 8), 2u);
  store_u32(second + 8, 1);
  seal(image);
  expect_own_memory_everywhere(image);
  Finger finger(image);
  const Motion motion(400);
  const auto rows_there = sliding_rows(finger);
  for (std::size_t k = 0; k < 400; ++k) {
    const tendonfmu_inputs inputs = motion.row(k);
    ASSERT_EQ(k == 0 ? tendonfmu_initialise(finger, motion.time[k], &inputs)
                     : tendonfmu_step(finger, motion.time[k], &inputs),
              TENDONFMU_OK);
    for (std::size_t j = 0; j < finger.handle->joints; ++j) {
      const std::size_t share = PRESLIDING_NUMBERS * j + PRESLIDING_SHARE;
      EXPECT_EQ(finger.handle->scratch.grip[j * finger.handle->tendon_lanes],
                rows_there[0]->memory[share] * rows_there[1]->memory[share]);
    }
  }
}

}  // namespace
