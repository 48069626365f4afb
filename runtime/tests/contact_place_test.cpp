// Where a finger is touched: kinematics against finite differences, the force at the tip, the least link.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "core_inside.h"

namespace {

using Three = std::array<double, 3>;

Three operator+(const Three& a, const Three& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Three operator-(const Three& a, const Three& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Three operator*(double s, const Three& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
double dot(const Three& a, const Three& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Three cross(const Three& a, const Three& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double length(const Three& a) {
  return std::sqrt(dot(a, a));
}

/* A chain with its axes as a description gives them. */
struct Chain {
  std::vector<Three> axis, offset;
  Three tip;

  std::size_t joints() const { return axis.size(); }

  /* Where a point of a link is: from the tip to the base, turned by vectors alone; no frames as in the product. */
  Three place(std::size_t link, Three point, const std::vector<double>& angle) const {
    for (std::size_t j = link + 1; j-- > 0;) {
      const Three e = (1.0 / length(axis[j])) * axis[j];
      const Three along = dot(e, point) * e, across = point - along;
      point = offset[j] + along + std::cos(angle[j]) * across + std::sin(angle[j]) * cross(e, point);
    }
    return point;
  }

  /* Torques that the tendons hold against a force on a point of a link, by the virtual work of small turns. */
  std::vector<double> torques(std::size_t link, const Three& point, const Three& force,
                              const std::vector<double>& angle) const {
    const double step = 1e-6;
    std::vector<double> torque;
    for (std::size_t j = 0; j < joints(); ++j) {
      std::vector<double> forth = angle, back = angle;
      forth[j] += step;
      back[j] -= step;
      torque.push_back(-dot(force, place(link, point, forth) - place(link, point, back)) / (2 * step));
    }
    return torque;
  }
};

/* What the product makes of a chain. */
struct Placed {
  std::vector<double> axis, offset;
  Three tip;
  std::size_t joints;

  explicit Placed(const Chain& chain) : tip(chain.tip), joints(chain.joints()) {
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

class Draws {
 public:
  double number(double scale = 1.0) { return scale * normal_(random_); }
  Three vector(double scale = 1.0) { return {number(scale), number(scale), number(scale)}; }
  std::vector<double> numbers(std::size_t count, double scale = 1.0) {
    std::vector<double> drawn(count);
    for (double& x : drawn) {
      x = number(scale);
    }
    return drawn;
  }
  Chain chain(std::size_t joints) {
    Chain chain;
    for (std::size_t j = 0; j < joints; ++j) {
      chain.axis.push_back(vector(std::pow(10.0, number())));
      chain.offset.push_back(vector(0.03));
    }
    chain.tip = vector(0.03);
    return chain;
  }
  std::vector<double> deviations(std::size_t count) {
    std::vector<double> drawn(count);
    for (double& x : drawn) {
      x = 0.003 * std::exp(number(0.5));
    }
    return drawn;
  }

 private:
  std::mt19937_64 random_{5};
  std::normal_distribution<> normal_;
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

TEST(LinkGeometry, LeversAreTheSlopesOfTheTipsPlace) {
  Draws draws;
  for (int trial = 0; trial < 200; ++trial) {
    const Chain chain = draws.chain(1 + trial % 16);
    const std::size_t last = chain.joints() - 1;
    const std::vector<double> angle = draws.numbers(chain.joints()), lever = Placed(chain).levers(angle);
    for (int k = 0; k < 3; ++k) {
      Three unit{};
      unit[k] = 1.0;
      const std::vector<double> torque = chain.torques(last, chain.tip, unit, angle);
      for (std::size_t j = 0; j <= last; ++j) {
        EXPECT_NEAR(lever[3 * j + k], -torque[j], 1e-9) << trial;
      }
    }
  }
}

TEST(LinkGeometry, AxesOfAnyLengthAreDirections) {
  for (const double scale : {1e-300, 1e-170, 1.0, 1e170, 1e300}) {
    Three vector = {2.0 * scale, -scale, 2.0 * scale};
    make_unit(vector.data());
    EXPECT_DOUBLE_EQ(vector[0], 2.0 / 3.0);
    EXPECT_DOUBLE_EQ(vector[1], -1.0 / 3.0);
  }
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

TEST(TipForce, AlongAStretchedFingerIsNotObservable) {
  Placed finger(index_finger());
  const std::vector<double> deviation(4, 0.004);
  /* bent a little, the axial force turns joints a little: told from where its deviation is ten times the best one's */
  bool before = false;
  for (const double bend : {0.0, 0.02, 0.1, 0.4, 0.8}) {
    const std::vector<double> lever = finger.levers({0.1, bend, bend, bend});
    std::vector<double> torque;
    for (std::size_t j = 0; j < 4; ++j) {
      torque.push_back(-lever[3 * j]); /* 1 N along x */
    }
    const tip_force found = find_tip_force(4, lever.data(), torque.data(), deviation.data());
    EXPECT_FALSE(before && !found.observable) << bend;
    before = found.observable;
    EXPECT_LE(length({found.force[0], found.force[1], found.force[2]}), 1.0 + 1e-9); /* never more than the force */
    EXPECT_LT(found.misfit, 1e-9);
  }
  EXPECT_FALSE(find_tip_force(4, finger.levers({0, 0, 0, 0}).data(), deviation.data(), nullptr).observable);
  EXPECT_TRUE(before);
}

TEST(TipForce, NothingTurnsAFingerWhoseTipIsOnItsAxes) {
  Chain chain = planar();
  chain.offset[1] = chain.tip = {0, 0, 0};
  const std::vector<double> lever = Placed(chain).levers({0.1, 0.2}), torque = {0.1, -0.2}, deviation = {0.1, 0.1};
  const tip_force found = find_tip_force(2, lever.data(), torque.data(), deviation.data());
  EXPECT_FALSE(found.observable);
  EXPECT_EQ(length({found.force[0], found.force[1], found.force[2]}), 0.0);
  EXPECT_DOUBLE_EQ(found.misfit, 2.5); /* (1 + 4)/2: no force at the tip explains them */
}

TEST(TipForce, StaysFiniteAtTheEdgesOfDoubles) {
  Draws draws;
  for (const double lever_scale : {1e-160, 1e-20, 1.0, 1e2}) {
    for (const double torque_scale : {0.0, 1e-300, 1.0, 1e30}) {
      for (const double deviation_scale : {1e-160, 1e-3, 1e9}) {
        const std::vector<double> lever = draws.numbers(12, lever_scale), torque = draws.numbers(4, torque_scale);
        std::vector<double> deviation = draws.deviations(4);
        for (double& x : deviation) {
          x *= deviation_scale;
        }
        deviation[1] *= 1e12;
        const tip_force found = find_tip_force(4, lever.data(), torque.data(), deviation.data());
        for (const double x : found.force) {
          EXPECT_TRUE(std::isfinite(x));
        }
        for (const double x : found.deviation) {
          EXPECT_TRUE(std::isfinite(x));
        }
        EXPECT_TRUE(std::isfinite(found.misfit));
        EXPECT_LE(found.misfit, 1e12);
      }
    }
  }
}

/* What is claimed: contact is on the link that is named, or beyond. */
TEST(ContactLink, NeverLiesBeyondTheForce) {
  Draws draws;
  std::vector<int> named(6);
  for (int trial = 0; trial < 2000; ++trial) {
    const std::size_t n = 1 + trial % 5, link = static_cast<std::size_t>(trial / 5) % n;
    const Chain chain = draws.chain(n);
    const std::vector<double> angle = draws.numbers(n);
    const std::vector<double> torque = chain.torques(link, draws.vector(0.02), draws.vector(), angle);
    const std::vector<double> deviation(n, 1e-4);
    const int found = find_contact_link(n, Placed(chain).least().data(), torque.data(), deviation.data());
    EXPECT_LE(found, static_cast<int>(link) + 1) << trial;
    named[static_cast<std::size_t>(found == static_cast<int>(link) + 1)] += 1;
  }
  EXPECT_GT(named[1], 1900); /* the very link: a force through an axis is rare */
}

}  // namespace
