// unknowns.h: the columns of an estimation, and the numbers of the description that they stand for.
#include "unknowns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "made_recording.h"
#include "recording_track.h"

namespace {

using made::Json;
using made::Numbers;
using tendonfmu::estimation::free_finger;
using tendonfmu::estimation::unknown_list;
using Groups = std::vector<std::int32_t>;

/* A finger of the core for a description, and its parameters by path. */
class Described {
 public:
  explicit Described(const Json& description)
      : image_(made::image_of(description)), free_(image_.data(), image_.size()) {}

  tendonfmu_finger* finger() const { return free_.get(); }
  std::size_t count() const { return finger()->shape.parameter_count; }
  Groups fixed() const { return Groups(count(), -1); }
  Numbers start() const { return {finger()->start, finger()->start + count()}; }
  std::size_t at(const std::string& path) const {
    const std::uint32_t found = parameter_find(&finger()->shape, path.c_str());
    EXPECT_LT(found, count()) << path;
    return found;
  }
  /* what the core says to these numbers */
  tendonfmu_status set(const Numbers& numbers) const {
    return tendonfmu_set_parameters(finger(), numbers.size(), nullptr, numbers.data());
  }

 private:
  std::vector<unsigned char> image_;
  free_finger free_;
};

TEST(Unknowns, GoToTheDescriptionAndBack) {
  const Described d(made::learnable_finger());
  const unknown_list all(d.finger(), {}, {});
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform;
  const Numbers start = d.start(), first = all.read(start.data()), again = all.write(first.data());
  for (std::size_t p = 0; p < start.size(); ++p) {
    EXPECT_NEAR(again[p], start[p], 1e-15 * std::fabs(start[p])) << p;
  }
  for (int round = 0; round < 50; ++round) {
    Numbers z(all.count());
    for (std::size_t k = 0; k < z.size(); ++k) {
      z[k] = std::min(std::max(3.0 * uniform(random) * all[k].scale, all[k].lower), all[k].upper);
    }
    const Numbers numbers = all.write(z.data()), back = all.read(numbers.data());
    ASSERT_EQ(d.set(numbers), TENDONFMU_OK) << tendonfmu_last_error(d.finger());
    for (std::size_t k = 0; k < z.size(); ++k) { /* a drop is a difference */
      ASSERT_NEAR(back[k], z[k], 1e-12 * (z[k] + all[k].scale)) << all[k].path;
    }
  }
}

/* every corner of the box is a description that the core takes */
TEST(Unknowns, BoundsAreWithinWhatTheCoreTakes) {
  for (const Json& description : {small_finger(), made::learnable_finger()}) {
    const Described d(description);
    const unknown_list all(d.finger(), {}, {});
    std::mt19937_64 random(2);
    for (int corner = 0; corner < 100; ++corner) {
      Numbers z;
      for (std::size_t k = 0; k < all.count(); ++k) {
        const bool upper = corner == 0 || (corner > 1 && random() % 2);
        z.push_back(upper ? all[k].upper : all[k].lower);
        ASSERT_LE(all[k].lower, all[k].start);
        ASSERT_LE(all[k].start, all[k].upper);
        ASSERT_GT(all[k].scale, 0.0);
      }
      ASSERT_EQ(d.set(all.write(z.data())), TENDONFMU_OK) << tendonfmu_last_error(d.finger());
    }
  }
}

TEST(Unknowns, SharedNumbersHaveOneColumn) {
  const Described d(made::learnable_finger());
  Groups group = d.fixed();
  const std::size_t a = d.at("tendons[1].pulley_friction[1].coulomb"),
                    b = d.at("tendons[1].edge_friction[1].positive.coulomb");
  group[a] = group[b] = 7;
  const unknown_list shared(d.finger(), group, {});
  ASSERT_EQ(shared.count(), 1u);
  EXPECT_EQ(shared[0].parameters.size(), 2u);
  EXPECT_DOUBLE_EQ(shared[0].start, 0.5 * (0.015 + 0.02));
  EXPECT_EQ(shared[0].joint, 0u);
  const double z = 0.012;
  const Numbers numbers = shared.write(&z);
  EXPECT_EQ(numbers[a], z);
  EXPECT_EQ(numbers[b], z);
  EXPECT_DOUBLE_EQ(shared.read(numbers.data())[0], z);
  EXPECT_EQ(numbers[a - 1], 0.02) << "a static friction that is fixed stays";
  EXPECT_EQ(shared.side(static_cast<std::uint32_t>(a - 1)).run_length, 0u) << "others add to its column";
}

}  // namespace
