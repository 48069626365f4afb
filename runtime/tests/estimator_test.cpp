// The estimator of tendonfmu_estimation.hpp: what its calls give, on fingers whose truth is known, and what they
// refuse.
#include <algorithm>
#include <limits>

#include "made_recording.h"

namespace {

using made::Json;
using made::Numbers;
using made::refusal;
using tendonfmu::estimation::estimator;
using tendonfmu::estimation::fit_options;
using tendonfmu::estimation::fit_result;

const double nan = std::numeric_limits<double>::quiet_NaN();

/* the truth, a guess 20 % off, and what the truth does */
struct Case {
  explicit Case(unsigned seed, std::size_t samples, const Json& description = made::learnable_finger())
      : truth(description), recording(made::made(truth, samples, 0.004, seed)) {
    std::mt19937_64 random(seed);
    guess = made::disturbed(truth, 0.2, &random);
  }

  Json truth, guess;
  made::Recording recording;
};

/* --- what the calls give --------------------------------------------------------------------------------------------
 */

TEST(Estimator, EvaluationHasTheSameBitsWithAnyNumberOfThreads) {
  const Case c(22, 5000), d(23, 2100);
  estimator e = made::estimator_of(c.guess);
  e.add_recording(c.recording.arrays());
  e.add_recording(d.recording.arrays());
  const auto one = e.evaluate(e.start(), 1, 1);
  for (const unsigned threads : {2u, 3u, 64u}) {
    const auto several = e.evaluate(e.start(), 1, threads);
    EXPECT_EQ(several.cost, one.cost);
    EXPECT_EQ(several.gradient, one.gradient);
    EXPECT_EQ(several.information, one.information);
  }
}

TEST(Estimator, FitFindsTheTruthToWithinItsErrors) {
  const Case c(25, 8000);
  estimator e = made::estimator_of(c.guess);
  e.add_recording(c.recording.arrays());
  fit_options options;
  options.prior_std = 3.0;
  options.tolerance = 0.01;
  const fit_result fit = e.fit(e.start(), options);
  EXPECT_TRUE(fit.converged);
  EXPECT_FALSE(fit.stopped);
  const Numbers truth = made::truth_of(c.truth);
  const std::size_t u = truth.size();
  double squares = 0.0;
  for (std::size_t k = 0; k < u; ++k) {
    const double error = std::sqrt(fit.covariance[k * u + k]);
    EXPECT_LT(std::fabs(fit.z[k] - truth[k]), 5.0 * error) << e.unknowns()[k].path;
    EXPECT_GE(fit.z[k], e.unknowns()[k].lower);
    EXPECT_LE(fit.z[k], e.unknowns()[k].upper);
    squares += (fit.z[k] - truth[k]) * (fit.z[k] - truth[k]) / (error * error) / static_cast<double>(u);
  }
  EXPECT_LT(squares, 2.5);
  const auto there = e.evaluate(fit.z);
  EXPECT_DOUBLE_EQ(there.cost + fit.prior_cost, fit.cost);
  EXPECT_EQ(there.gradient, fit.gradient);
  EXPECT_LT(there.cost, e.evaluate(truth).cost + 1e-6 * fit.cost) << "the truth explains what is seen less well";
}

/* the joints' parts of the sums are weighted alone, and a weight of 1 changes no bit */
TEST(Estimator, WeightsScaleWhatEachJointAddsToTheSums) {
  const Case c(31, 2300);
  estimator e = made::estimator_of(c.guess);
  e.add_recording(c.recording.arrays());
  const auto plain = e.evaluate(e.start());
  const auto weighted = [&](double first, double second) {
    e.set_weights(0, {first, second});
    return e.evaluate(e.start());
  };
  const auto same = weighted(1.0, 1.0), first = weighted(0.25, 1.0), second = weighted(1.0, 0.25);
  EXPECT_EQ(plain.cost, same.cost);
  EXPECT_EQ(plain.gradient, same.gradient);
  EXPECT_EQ(plain.information, same.information);
  EXPECT_NEAR(first.cost + second.cost, 1.25 * plain.cost, 1e-12 * plain.cost);
  EXPECT_LT(std::max(first.cost, second.cost), 0.99 * plain.cost);
  const std::size_t u = plain.gradient.size();
  for (std::size_t k = 0; k < u * u; ++k) {
    const double size = std::sqrt(plain.information[(k / u) * (u + 1)] * plain.information[(k % u) * (u + 1)]);
    ASSERT_NEAR(first.information[k] + second.information[k], 1.25 * plain.information[k], 1e-10 * size);
  }
}

TEST(Estimator, AStoppedFitGivesTheBestSoFar) {
  const Case c(27, 4200);
  estimator e = made::estimator_of(c.guess);
  e.add_recording(c.recording.arrays());
  for (std::size_t asked = 0; asked < 2; ++asked) {
    const fit_result some = e.fit(e.start(), {}, [&](const auto& p) { return p.pass <= asked; });
    EXPECT_TRUE(some.stopped);
    EXPECT_FALSE(some.converged);
    ASSERT_EQ(some.passes, asked);
    if (asked) {
      EXPECT_TRUE(std::isfinite(some.cost + some.gradient[0] + some.information[0] + some.covariance[0]));
    } else {
      EXPECT_EQ(some.z, e.start());
      EXPECT_TRUE(some.gradient.empty() && some.information.empty() && some.covariance.empty());
    }
  }
}

/* --- what they refuse -----------------------------------------------------------------------------------------------
 */

TEST(Estimator, RefusesRecordingsItCannotWeigh) {
  const Case c(29, 50);
  estimator e = made::estimator_of(c.truth);
  const auto why = [&](const made::Recording& r) { return refusal([&] { e.add_recording(r.arrays()); }); };
  made::Recording r = c.recording;
  r.samples = 1;
  EXPECT_EQ(why(r), "samples = 1: expected at least 2");
  r = c.recording;
  std::fill(r.use.begin() + 1, r.use.end(), 0);
  EXPECT_EQ(why(r), "1 samples to learn from: expected at least 2");
  r = c.recording;
  r.external[2 * 30 + 1] = nan;
  EXPECT_EQ(why(r), "row 31: external_torque[2]: expected a finite number, N.m");
  r = c.recording;
  r.time[20] = r.time[19];
  EXPECT_EQ(why(r).find("row 21: time"), 0u);
  r = c.recording;
  r.force[2 * 10] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(why(r).find("row 11: "), 0u);
  auto none = c.recording.arrays();
  none.inputs.tendon_force = nullptr;
  EXPECT_NE(refusal([&] { e.add_recording(none); }), "");
  Json silent = c.truth;
  silent["bias"]["noise_std"] = 0.0;
  estimator certain = made::estimator_of(silent);
  EXPECT_EQ(refusal([&] { certain.add_recording(c.recording.arrays()); }).find("bias.noise_std = 0: expected above 0"),
            0u);
  EXPECT_EQ(refusal([&] { e.evaluate(e.start()); }), "no recording: expected at least one")
      << "none of the refused ones stayed";
  EXPECT_EQ(why(c.recording), "");
}

TEST(Estimator, RefusesArgumentsInOneLineThatSaysWhy) {
  const Case c(30, 50);
  estimator e = made::estimator_of(c.truth);
  e.add_recording(c.recording.arrays());
  const Numbers start = e.start();
  const std::string path = e.unknowns()[1].path, count = std::to_string(start.size());
  Numbers z = start;
  for (const double wrong : {nan, -1.0, 1e12}) { /* outside its box */
    z[1] = wrong;
    EXPECT_EQ(refusal([&] { e.values(z); }).find("unknown 1 (" + path + ") = "), 0u);
  }
  z[1] = nan;
  EXPECT_EQ(refusal([&] { e.fit(z); }).find("unknown 1 (" + path + ") = nan"), 0u);
  fit_options options;
  options.prior_std = 0.0;
  EXPECT_EQ(refusal([&] { e.fit(start, options); }).find("prior_std = 0"), 0u);
  EXPECT_EQ(refusal([&] { e.innovations(1, start); }), "recording 1: expected below 1");
  EXPECT_EQ(refusal([&] { e.values({}); }), "z: expected " + count + " unknowns");
  const auto rows = [&](std::size_t first, std::size_t blocks, std::size_t length) {
    return refusal([&] { e.jacobian(0, start, first, blocks, length); });
  };
  EXPECT_NE(rows(40, 11, 1), "");
  EXPECT_NE(rows(2, SIZE_MAX, 2), "");
  EXPECT_NE(rows(51, 0, 1), "");
  EXPECT_NE(rows(0, 1, 0), "");
  EXPECT_EQ(rows(50, 0, 1), "");
  for (const double wrong : {0.0, -1.0, 1.5, nan}) {
    EXPECT_NE(refusal([&] { e.set_weights(0, {1.0, wrong}); }).find("weight[2]"), std::string::npos);
  }
  EXPECT_EQ(refusal([&] { e.set_weights(0, {1.0}); }), "weight: expected 2 numbers, one a joint");
  for (const double wrong : {nan, -1.0}) {
    Numbers known(start.size() * start.size(), 0.0);
    known[0] = wrong;
    EXPECT_EQ(refusal([&] { e.set_known(known); }), "information: expected a symmetric, positive semidefinite matrix");
  }
}

TEST(Estimator, RefusesBadImagesAndCounts) {
  EXPECT_EQ(refusal([] { estimator("nonsense", 8); }).find("not a model image"), 0u);
  EXPECT_NE(refusal([] { estimator(nullptr, 0); }), "");
  const std::vector<unsigned char> image = made::image_of(made::learnable_finger());
  EXPECT_EQ(refusal([&] { estimator(image.data(), image.size(), {1, 2}); }).find("group: expected "), 0u);
  EXPECT_EQ(refusal([&] { estimator(image.data(), image.size(), {}, {1.0}); }).find("scale: expected "), 0u);
}

}  // namespace
