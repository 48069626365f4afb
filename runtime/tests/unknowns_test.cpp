// unknowns.h: the columns of an estimation, and the numbers of the description that they stand for.
#include "unknowns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "made_recording.h"
#include "recording_track.h"
#include "refusal.h"

namespace {

using made::Json;
using made::Numbers;
using tendonfmu::estimation::free_finger;
using tendonfmu::estimation::refused;
using tendonfmu::estimation::unknown_item;
using tendonfmu::estimation::unknown_list;
using tendonfmu::estimation::unknown_role;
using Groups = std::vector<std::int32_t>;

const double nan = std::numeric_limits<double>::quiet_NaN();

/* A finger of the core for a description, and its parameters by path. */
class Described {
 public:
  explicit Described(const Json& description)
      : image_(made::image_of(description)), free_(image_.data(), image_.size()) {}

  tendonfmu_finger* finger() const { return free_.get(); }
  std::size_t count() const { return finger()->shape.parameter_count; }
  Groups fixed() const { return Groups(count(), -1); }
  Numbers no_scale() const { return Numbers(count(), nan); }
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
  std::string why_not(const Groups& group, const double* scale = nullptr) const {
    try {
      unknown_list(finger(), group.data(), scale);
    } catch (const refused& reason) {
      return reason.what();
    }
    return "";
  }

 private:
  std::vector<unsigned char> image_;
  free_finger free_;
};

std::size_t column_of(const unknown_list& unknowns, unknown_role role, std::size_t parameter) {
  for (std::size_t k = 0; k < unknowns.count(); ++k) {
    const auto& moved = unknowns[k].parameters;
    if (unknowns[k].role == role && std::count(moved.begin(), moved.end(), parameter) > 0) {
      return k;
    }
  }
  ADD_FAILURE() << "parameter " << parameter << " has no column";
  return 0;
}

const char* const pulley = "tendons[1].pulley_friction[1]";
const char* const edge = "tendons[2].edge_friction[1]";

std::string number(const std::string& law, const char* name) {
  return law + "." + name;
}

TEST(Unknowns, AreTheNumbersThatArePresent) {
  Json description = small_finger();
  description["tendons"][0]["pulley_friction"][0]["coulomb"] = 0.02; /* as its static: no Stribeck effect */
  const Described d(description);
  const unknown_list all(d.finger(), nullptr, nullptr);
  std::size_t estimated = 0;
  const auto moved = [&](const std::string& path) {
    std::size_t times = 0;
    for (std::size_t k = 0; k < all.count(); ++k) {
      times += static_cast<std::size_t>(
          std::count(all[k].parameters.begin(), all[k].parameters.end(), static_cast<std::uint32_t>(d.at(path))));
    }
    estimated += times;
    return times;
  };
  EXPECT_EQ(moved("joints[1].cover.stiffness"), 1u);
  EXPECT_EQ(moved("joints[1].cover.rest_angle"), 0u);
  EXPECT_EQ(moved("extensions[1].stiffness"), 1u);
  EXPECT_EQ(moved("bias.initial_torque[2]"), 1u);
  EXPECT_EQ(moved(number(pulley, "coulomb")), 1u);
  EXPECT_EQ(moved(number(pulley, "static")), 0u) << "follows coulomb";
  EXPECT_EQ(moved(number(pulley, "stribeck_velocity")), 0u);
  EXPECT_EQ(moved("tendons[1].edge_friction[2].laws[1].viscous"), 0u) << "0: absent";
  EXPECT_EQ(moved("tendons[1].edge_friction[2].laws[2].stribeck_velocity"), 1u);
  EXPECT_EQ(moved("tendons[1].edge_friction[1].negative.viscous"), 1u);
  EXPECT_EQ(moved("tendons[1].stiffness") + moved("bias.noise_std"), 0u);
  EXPECT_EQ(estimated, 6u);
  EXPECT_TRUE(std::is_sorted(&all[0], &all[0] + all.count(),
                             [](const unknown_item& a, const unknown_item& b) { return a.joint < b.joint; }));
}

TEST(Unknowns, GoToTheDescriptionAndBack) {
  const Described d(made::learnable_finger());
  const unknown_list all(d.finger(), nullptr, nullptr);
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
    const unknown_list all(d.finger(), nullptr, nullptr);
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
  const std::size_t a = d.at(number(pulley, "coulomb")), b = d.at("tendons[1].edge_friction[1].positive.coulomb");
  group[a] = group[b] = 7;
  const unknown_list shared(d.finger(), group.data(), nullptr);
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

TEST(Unknowns, StaticFrictionFollowsWhereItSharesWithCoulomb) {
  const Described d(made::learnable_finger());
  Groups group = d.fixed();
  const std::size_t first = d.at(number(pulley, "static"));
  group[first] = group[first + 1] = 0;
  group[first + 2] = 1;
  const unknown_list tied(d.finger(), group.data(), nullptr);
  ASSERT_EQ(tied.count(), 2u);
  const std::size_t coulomb = column_of(tied, unknown_role::coulomb, first + 1);
  Numbers z = {0.0, 0.0};
  z[coulomb] = 0.031;
  z[1 - coulomb] = 200.0;
  const Numbers numbers = tied.write(z.data());
  EXPECT_EQ(numbers[first], 0.031);
  EXPECT_EQ(numbers[first + 1], 0.031);
  EXPECT_EQ(numbers[first + 2], 1.0 / 200.0);
  ASSERT_EQ(tied.rates().size(), 1u);
  EXPECT_EQ(tied.fixed_drop(0), 0.0) << "no Stribeck effect is left, whatever the description starts with";
}

TEST(Unknowns, RefusalsNameTheNumber) {
  Json description = made::learnable_finger();
  description["tendons"][0]["pulley_friction"][0]["coulomb"] = 0.0;
  description["tendons"][0]["pulley_friction"][0]["viscous"] = 0.0;
  for (Json* law : {&description["tendons"][0]["edge_friction"], &description["tendons"][1]["edge_friction"]}) {
    *law = Json::array({nullptr, nullptr});
  }
  const Described d(description);
  Groups group = d.fixed();
  group[d.at("tendons[2].moment_arms[1]")] = 0;
  EXPECT_EQ(d.why_not(group).find("tendons[2].moment_arms[1]: not a number that can be estimated"), 0u);
  group = d.fixed();
  group[d.at("joints[1].friction.coulomb")] = group[d.at("joints[1].friction.viscous")] = 3;
  EXPECT_EQ(
      d.why_not(group),
      "joints[1].friction.viscous: shares its value with joints[1].friction.coulomb; expected numbers of the same "
      "kind");
  group = d.fixed();
  group[d.at(number(pulley, "viscous"))] = 0;
  EXPECT_EQ(d.why_not(group).find("tendons[1].pulley_friction[1].viscous = 0: "), 0u);
  Numbers scale = d.no_scale();
  scale[d.at(number(pulley, "viscous"))] = 0.2;
  EXPECT_EQ(d.why_not(group, scale.data()), "");
}

TEST(Unknowns, MayBeNone) {
  const Described d(made::learnable_finger());
  const unknown_list none(d.finger(), d.fixed().data(), nullptr);
  EXPECT_EQ(none.count(), 0u);
  EXPECT_EQ(none.write(nullptr), d.start());
  EXPECT_TRUE(none.read(d.start().data()).empty());
}

}  // namespace
