// Where a finger is touched, at the edges: links without length, a stretched finger, the ends of doubles. The rest is
// the oracle's (python_tests/model/test_link_geometry.py).
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "core_inside.h"

namespace {

using Three = std::array<double, 3>;

/* A chain with its axes as a description gives them. */
struct Chain {
  std::vector<Three> axis, offset;
  Three tip;
};

/* What the product makes of a chain. */
struct Placed {
  std::vector<double> axis, offset;
  Three tip;
  std::size_t joints;

  explicit Placed(const Chain& chain) : tip(chain.tip), joints(chain.axis.size()) {
    for (std::size_t j = 0; j < joints; ++j) {
      Three unit = chain.axis[j];
      make_unit(unit.data());
      axis.insert(axis.end(), unit.begin(), unit.end());
      offset.insert(offset.end(), chain.offset[j].begin(), chain.offset[j].end());
    }
  }
  link_geometry view() { return {axis.data(), offset.data(), tip.data()}; }
  std::vector<double> levers(const std::vector<double>& angle) {
    std::vector<double> lever(3 * joints);
    const link_geometry geometry = view();
    find_tip_levers(&geometry, joints, angle.data(), lever.data());
    return lever;
  }
  std::vector<int> least() {
    std::vector<int> link(joints);
    const link_geometry geometry = view();
    find_least_links(&geometry, joints, link.data());
    return link;
  }
};

/* Two links of 50 and 30 mm in a plane, axes along y: sideways forces turn nothing. */
Chain planar() {
  return {{{0, 1, 0}, {0, 2, 0}}, {{0, 0, 0}, {0.05, 0, 0}}, {0.03, 0, 0}};
}

/* The index finger's: a saddle joint, then two hinges. */
Chain index_finger() {
  return {{{0, 0, 1}, {0, 1, 0}, {0, 1, 0}, {0, 1, 0}},
          {{0, 0, 0}, {0, 0, 0}, {0.045, 0, 0}, {0.028, 0, 0}},
          {0.022, 0, 0}};
}

TEST(LinkGeometry, LinksWithoutLengthAreNotTouched) {
  EXPECT_EQ(Placed(index_finger()).least(), (std::vector<int>{2, 2, 3, 4}));
  EXPECT_EQ(Placed(planar()).least(), (std::vector<int>{1, 2}));
  Chain turning_on_itself = planar(); /* the last link is a rod that turns about its own length */
  turning_on_itself.axis[1] = {3, 0, 0};
  EXPECT_EQ(Placed(turning_on_itself).least(), (std::vector<int>{1, 2}));
  turning_on_itself.tip = {0, 0, 0};
  turning_on_itself.offset[1] = {0, 1e-12, 0};
  EXPECT_EQ(Placed(turning_on_itself).least(), (std::vector<int>{2, 2}));
}

// by hand; what is in the plane is found, nothing is made up across it
TEST(TipForce, OfAPlanarFingerIsThatInItsPlane) {
  const double first = 0.3, both = 0.3 + 0.9;
  const std::vector<double> lever = Placed(planar()).levers({0.3, 0.9});
  const double x = -0.03 * std::sin(both), z = -0.03 * std::cos(both);
  const double expected[] = {x - 0.05 * std::sin(first), 0.0, z - 0.05 * std::cos(first), x, 0.0, z};
  const Three force = {0.4, 0.7, -1.1};
  std::vector<double> torque(2, 0.0);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_NEAR(lever[k], expected[k], 1e-15) << k;
    torque[k / 3] -= expected[k] * force[k % 3];
  }
  const tip_force found = find_tip_force(2, lever.data(), torque.data(), nullptr);
  EXPECT_FALSE(found.observable);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(found.force[k], k == 1 ? 0.0 : force[k], 1e-12) << k;
    EXPECT_EQ(found.deviation[k], 0.0) << "not known";
  }
}

TEST(TipForce, StaysFiniteAtTheEdgesOfDoubles) {
  std::mt19937_64 random(5);
  const auto numbers = [&](std::size_t count, double scale) {
    std::vector<double> drawn(count);
    for (double& x : drawn) {
      x = scale * std::normal_distribution<>()(random);
    }
    return drawn;
  };
  for (const double lever_scale : {1e-160, 1e-20, 1.0, 1e2}) {
    for (const double torque_scale : {0.0, 1e-300, 1.0, 1e30}) {
      for (const double scale : {1e-160, 1e-3, 1e9}) {
        const std::vector<double> lever = numbers(12, lever_scale), torque = numbers(4, torque_scale);
        const std::vector<double> deviation = {scale, 1e12 * scale, 0.7 * scale, 2.0 * scale};
        const tip_force found = find_tip_force(4, lever.data(), torque.data(), deviation.data());
        for (int k = 0; k < 3; ++k) {
          EXPECT_TRUE(std::isfinite(found.force[k]) && std::isfinite(found.deviation[k]));
        }
        EXPECT_TRUE(std::isfinite(found.misfit));
        EXPECT_LE(found.misfit, 1e12);
      }
    }
  }
}

}  // namespace
