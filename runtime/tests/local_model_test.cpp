// local_model.h against the cost itself at points nearby, and boxed_step against all of its active sets.
#include "local_model.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "made_recording.h"

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using made::Json;
using tendonfmu::estimation::boxed_step;
using tendonfmu::estimation::cost_evaluation;
using tendonfmu::estimation::evaluate;
using tendonfmu::estimation::fit_problem;
using tendonfmu::estimation::local_model;
using tendonfmu::estimation::scaled_box;
using tendonfmu::estimation::unknown_role;

/* --- the model of the cost ------------------------------------------------------------------------------------------
 */

/* A finger that expects other numbers than those that made its recording, and its cost around x. */
class Case {
 public:
  explicit Case(double prior = 0.0)
      : truth_(made::learnable_finger()),
        image_(made::image_of(guess())),
        problem_(image_.data(), image_.size(), {}, {}),
        box_(problem_.unknowns),
        prior_(prior) {
    made::Recording r = made::made(truth_, 2500, 0.004, 7);
    problem_.recordings.emplace_back(
        &problem_.finger, tendonfmu::estimation::recording_arrays{r.samples, r.time.data(), r.inputs(), r.load(),
                                                                  nullptr, TENDONFMU_JOINT_VELOCITIES});
    x = box_.start;
    at = pass(x);
  }

  const fit_problem& problem() const { return problem_; }
  const scaled_box& box() const { return box_; }
  local_model model() const { return {problem_, box_, at, x, prior_}; }
  cost_evaluation pass(const VectorXd& where) const { return evaluate(problem_, box_.unknowns(where), {1, 1}, {}); }
  double cost(const VectorXd& step) const {
    return pass(x + step).cost + 0.5 * prior_ * (x + step - box_.start).squaredNorm();
  }
  double error(const VectorXd& step) const { return std::fabs(model().cost(step) - cost(step)); }
  std::vector<Index> with(unknown_role role) const {
    std::vector<Index> found;
    for (std::size_t k = 0; k < problem_.unknowns.count(); ++k) {
      if (problem_.unknowns[k].role == role) {
        found.push_back(static_cast<Index>(k));
      }
    }
    return found;
  }

  VectorXd x;
  cost_evaluation at;

 private:
  static Json guess() {
    std::mt19937_64 random(3);
    return made::disturbed(made::learnable_finger(), 0.3, &random);
  }

  Json truth_;
  std::vector<unsigned char> image_;
  fit_problem problem_;
  scaled_box box_;
  double prior_;
};

VectorXd along(const Case& c, Index unknown, double length) {
  VectorXd step = VectorXd::Zero(c.x.size());
  step[unknown] = length;
  return step;
}

/* e is linear in the friction of a place, and that in all numbers of its law but the rate */
TEST(LocalModel, IsExactInWhatEntersLinearly) {
  const Case c(0.7);
  for (const unknown_role role :
       {unknown_role::coulomb, unknown_role::drop, unknown_role::viscous, unknown_role::value}) {
    for (const Index k : c.with(role)) {
      const double truth = c.cost(along(c, k, 0.4));
      EXPECT_NEAR(c.model().cost(along(c, k, 0.4)), truth, 1e-9 * truth) << c.problem().unknowns[std::size_t(k)].path;
    }
  }
}

/* Third order in e: what is left falls 16 times when the step is halved. */
TEST(LocalModel, ErrorFallsWithTheFourthPowerOfAStepInARate) {
  const Case c;
  std::size_t judged = 0;
  for (const Index k : c.with(unknown_role::rate)) {
    const double whole = c.error(along(c, k, 0.2)), half = c.error(along(c, k, 0.1));
    if (half > 1e-10 * c.at.cost) { /* above rounding */
      EXPECT_GT(whole / half, 12.0) << c.problem().unknowns[std::size_t(k)].path;
      EXPECT_LT(whole / half, 24.0) << c.problem().unknowns[std::size_t(k)].path;
      ++judged;
    }
  }
  EXPECT_GE(judged, 5u);
}

/* --- a step within a box --------------------------------------------------------------------------------------------
 */

struct Parabola {
  MatrixXd h;
  VectorXd g, x;
  scaled_box box;

  double at(const VectorXd& d) const { return g.dot(d) + 0.5 * d.dot(h * d); }
};

/* a box with nothing in it, to be filled */
scaled_box empty_box() {
  static const std::vector<unsigned char> image = made::image_of(made::learnable_finger());
  const tendonfmu::estimation::free_finger finger(image.data(), image.size());
  return scaled_box(tendonfmu::estimation::unknown_list(finger.get(), {}, {}));
}

Parabola random_parabola(Index p, std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const auto some = [&](double spread) {
    return VectorXd::NullaryExpr(p, [&] { return spread * normal(*random); }).eval();
  };
  Parabola q{MatrixXd::NullaryExpr(p, p, [&] { return normal(*random); }), some(2.0), some(1.0), empty_box()};
  q.h = (q.h * q.h.transpose()).eval();
  q.h.diagonal().array() += 0.01;
  q.box.curved.clear();
  q.box.lower = q.box.upper = q.x;
  for (Index k = 0; k < p; ++k) { /* at a side, at both, inside, or unbounded */
    const double kind = uniform(*random);
    q.box.lower[k] -= kind < 0.3 ? 0.0 : uniform(*random);
    q.box.upper[k] += kind > 0.2 && kind < 0.5 ? 0.0 : uniform(*random);
    if (kind > 0.9) {
      q.box.lower[k] = -std::numeric_limits<double>::infinity();
    }
  }
  return q;
}

/* the least of all choices of what is held at which side */
double least_by_brute_force(const Parabola& q) {
  const Index p = q.x.size();
  double least = std::numeric_limits<double>::infinity();
  std::vector<int> choice(static_cast<std::size_t>(p), 0);
  for (int number = 0; number < static_cast<int>(std::pow(3, p)); ++number) {
    VectorXd d = VectorXd::Zero(p);
    std::vector<Index> free;
    for (Index k = 0, rest = number; k < p; ++k, rest /= 3) {
      if (rest % 3 == 2) {
        free.push_back(k);
      } else {
        d[k] = (rest % 3 ? q.box.upper[k] : q.box.lower[k]) - q.x[k];
      }
    }
    if (!d.allFinite()) {
      continue;
    }
    const VectorXd pull = q.g + q.h * d;
    if (!free.empty()) {
      const VectorXd move = q.h(free, free).llt().solve(-pull(free));
      d(free) = move;
    }
    if (((q.x + d).array() >= q.box.lower.array() - 1e-12).all() &&
        ((q.x + d).array() <= q.box.upper.array() + 1e-12).all()) {
      least = std::min(least, q.at(d));
    }
  }
  return least;
}

TEST(BoxedStep, IsTheBestOfAllActiveSets) {
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 1500; ++trial) {
    const Parabola q = random_parabola(1 + trial % 5, &random);
    const VectorXd d = boxed_step(q.h, q.g, q.x, q.box);
    const VectorXd there = q.x + d;
    ASSERT_LT((q.box.clip(there) - there).cwiseAbs().maxCoeff(), 1e-12) << "trial " << trial;
    const double least = least_by_brute_force(q);
    ASSERT_NEAR(q.at(d), least, 1e-9 * (1.0 + std::fabs(least))) << "trial " << trial;
  }
}

/* an unknown that nothing depends on, and two that only their sum shows: without a prior h is singular */
TEST(BoxedStep, IsFiniteWhereTheMatrixIsSingular) {
  Parabola q{MatrixXd::Zero(4, 4), VectorXd::Zero(4), VectorXd::Constant(4, 0.5), empty_box()};
  q.box.curved.clear();
  q.box.lower = VectorXd::Zero(4);
  q.box.upper = VectorXd::Constant(4, 3.0);
  q.h(1, 1) = q.h(1, 2) = q.h(2, 1) = q.h(2, 2) = 4e6;
  q.h(3, 3) = 1e3;
  q.g << 0.0, -2e6, -2e6, 100.0;
  const VectorXd d = boxed_step(q.h, q.g, q.x, q.box);
  ASSERT_TRUE(d.allFinite()) << d.transpose();
  EXPECT_EQ(d[0], 0.0);
  EXPECT_NEAR(d[1] + d[2], 0.5, 1e-6);
  EXPECT_NEAR(d[3], -0.1, 1e-6);
}

}  // namespace
