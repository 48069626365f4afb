// The learner of tendonfmu_estimation.hpp on recordings whose truth is known.
#include <limits>

#include "allocation_count.h"
#include "made_recording.h"

namespace {

using made::Json;
using made::Learner;
using made::Numbers;
using made::Recording;
using made::refusal;

/* A finger, another that takes its numbers to be a fifth larger or smaller, and what the first one does. */
struct Case {
  explicit Case(unsigned seed, std::size_t samples = 6000) : description(made::learnable_finger()) {
    std::mt19937_64 random(seed);
    truth = made::disturbed(description, 0.2, &random);
    recording = made::made(truth, samples, 0.002, seed);
  }
  Json description, truth;
  Recording recording;
};

/* errors in standard errors */
Numbers normalised(const Learner& learner, const Numbers& expected) {
  const std::size_t u = learner.unknowns();
  const Numbers z = learner.z(), covariance = learner.covariance();
  Numbers errors(u);
  for (std::size_t i = 0; i < u; ++i) {
    errors[i] = (z[i] - expected[i]) / std::sqrt(covariance[i * u + i]);
  }
  return errors;
}

double largest(const Numbers& numbers) {
  double most = 0.0;
  for (const double x : numbers) {
    most = std::max(most, std::fabs(x));
  }
  return most;
}

/* standard errors where the truth is: what the data can tell, decided before anything is learned */
Numbers errors_at_truth(const Case& c) {
  Learner knows(c.truth);
  knows.run(c.recording);
  knows.run_again(c.recording);
  const Numbers covariance = knows.covariance();
  Numbers errors;
  for (std::size_t i = 0; i < knows.unknowns(); ++i) {
    errors.push_back(std::sqrt(covariance[i * knows.unknowns() + i]));
  }
  return errors;
}

TEST(Learner, FindsTheTruthWithinItsErrors) {
  double squares = 0.0;
  std::size_t identified = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Case c(seed, 20000);
    Learner learner(c.description);
    learner.run(c.recording);
    EXPECT_NEAR(made::mean_square(learner, 0), c.recording.noise_square, 0.01) << seed;
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(learner.bias()[j], c.recording.bias[(c.recording.samples - 1) * 2 + j], 0.006);
    }
    learner.run_again(c.recording);
    const Numbers truth = made::truth_of(c.truth), error = errors_at_truth(c), z = learner.z();
    for (std::size_t i = 0; i < z.size(); ++i) {
      if (error[i] < 0.3 * truth[i]) {
        EXPECT_LT(std::fabs(z[i] - truth[i]), 4.0 * error[i]) << seed << " " << learner->unknowns()[i].path;
        squares += std::pow((z[i] - truth[i]) / error[i], 2);
        ++identified;
      }
    }
  }
  EXPECT_GT(identified, 24u);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(identified)), 1.0, 0.35);
}

TEST(Learner, TakesSamplesOneByOneAsTheRunDoes) {
  const Case c(7, 503);
  Learner whole(c.description), steps(c.description);
  whole.run(c.recording);
  Numbers innovation(c.recording.samples * 2, std::nan("")), last(16), last_variance(16);
  for (std::size_t k = 0; k < c.recording.samples; ++k) {
    if (k == 0) {
      steps->initialise(c.recording.sample(0), 3);
      continue;
    }
    ASSERT_EQ(steps->step(c.recording.sample(k)), k % 8 == 0) << k;
    ASSERT_FALSE(steps->step(c.recording.sample(k))); /* the same time again: nothing */
    if (k % 8 == 0) {
      ASSERT_EQ(steps->get_innovations(last.data(), last_variance.data()), 8u);
      std::copy(last.begin(), last.end(), innovation.begin() + static_cast<std::ptrdiff_t>(2 * (k - 7)));
    }
  }
  steps->finish();
  EXPECT_EQ(steps.z(), whole.z());
  EXPECT_EQ(steps.covariance(), whole.covariance());
  EXPECT_EQ(steps.bias(), whole.bias());
  for (std::size_t k = 2; k < 2 * (c.recording.samples - 8); ++k) {
    ASSERT_EQ(innovation[k], whole.innovation[k]) << k;
  }
  EXPECT_TRUE(std::isnan(whole.innovation[0])); /* there the bias starts */
}

TEST(Learner, LearnsNothingFromSamplesThatAreNotUsed) {
  Case c(8, 3000);
  for (std::size_t k = 0; k < c.recording.samples; ++k) {
    c.recording.use[k] = k >= 20 && (k / 300) % 2 == 0;
  }
  Learner clean(c.description), spoilt(c.description);
  clean.run(c.recording);
  for (std::size_t k = 0; k < c.recording.samples; ++k) {
    c.recording.external[2 * k] += c.recording.use[k] ? 0.0 : 7.0; /* contact */
  }
  spoilt.run(c.recording);
  EXPECT_EQ(clean.z(), spoilt.z());
  EXPECT_EQ(clean.covariance(), spoilt.covariance());
  EXPECT_TRUE(std::isnan(clean.innovation[2 * 20])); /* the bias starts where the first is used */
  EXPECT_FALSE(std::isnan(clean.innovation[2 * 21]));
  EXPECT_NEAR(spoilt.innovation[2 * 310], clean.innovation[2 * 310] - 7.0, 1e-12);
  const Numbers errors = normalised(clean, made::truth_of(c.truth));
  EXPECT_LT(largest(errors), 4.0);
}

TEST(Learner, ARefusedSampleChangesNothing) {
  const Case c(13, 400);
  Learner clean(c.description), teased(c.description);
  clean.run(c.recording);
  const Numbers no_force(2, std::nan("")), load = {0.0, std::numeric_limits<double>::infinity()};
  EXPECT_EQ(refusal([&] { teased->step(c.recording.sample(0)); }),
            "a step before the first sample: expected initialise first");
  EXPECT_EQ(refusal([&] { teased->get_bias(nullptr, nullptr); }), "no bias before the first sample that is used");
  teased->initialise(c.recording.sample(0), 3);
  for (std::size_t k = 1; k < c.recording.samples; ++k) {
    tendonfmu::estimation::learner_sample bad[3] = {c.recording.sample(k), c.recording.sample(k),
                                                    c.recording.sample(k)};
    bad[0].inputs.tendon_force = no_force.data();
    bad[1].external_torque = load.data();
    bad[2].time -= 1.0;
    for (const auto& sample : bad) {
      ASSERT_NE(refusal([&] { teased->step(sample); }), "");
    }
    teased->step(c.recording.sample(k));
  }
  teased->finish();
  EXPECT_EQ(clean.z(), teased.z());
  EXPECT_EQ(clean.covariance(), teased.covariance());
}

TEST(Learner, SaysWhyItRefuses) {
  const auto reason = [](const Json& description, const tendonfmu::estimation::learner_options& options) {
    const std::vector<unsigned char> image = made::image_of(description);
    return refusal([&] { tendonfmu::estimation::make_learner(image.data(), image.size(), options); });
  };
  const Json good = made::learnable_finger();
  EXPECT_EQ(reason(good, {0.0, 8, 0.0}), "prior_std = 0.000000: expected above 0, at most 1e6 scales");
  EXPECT_EQ(reason(good, {1.0, 0, 0.0}), "block = 0: expected 1 to 64 samples");
  EXPECT_EQ(reason(good, {1.0, 65, 0.0}), "block = 65: expected 1 to 64 samples");
  EXPECT_EQ(reason(good, {1.0, 8, -1.0}), "parameter_drift = -1.000000: expected 0 to 1e6 1/s");
  Json silent = good;
  silent["bias"]["noise_std"] = 0.0;
  EXPECT_EQ(reason(silent, {}), "bias.noise_std = 0: expected above 0 N.m to learn, which weighs the residuals by it");

  Case c(14, 5);
  Learner learner(good);
  c.recording.time[3] = c.recording.time[2];
  EXPECT_EQ(refusal([&] { learner->run(c.recording.arrays()); }), "row 4: time: expected later than the row before");
  c.recording.samples = 1;
  EXPECT_EQ(refusal([&] { learner->run(c.recording.arrays()); }), "samples = 1: expected at least 2");
  EXPECT_EQ(refusal([&] { learner->initialise(c.recording.sample(0), 4); }).find("kinematics_source: expected 1"), 0u);
}

TEST(Learner, StopsWhenTheWatchSaysSo) {
  const Case c(15, 3000);
  Learner learner(c.description);
  EXPECT_EQ(
      learner->run(c.recording.arrays(), nullptr, nullptr, [](std::size_t row, std::size_t) { return row < 1000; }),
      1001u);
}

TEST(Learner, StepAllocatesNothing) {
#if defined(COUNTS_ALLOCATIONS)
  ASSERT_TRUE(allocations_count());
  const Case c(16, 2000);
  Learner learner(c.description);
  Numbers values(learner->parameter_count()), errors = values, bias(2);
  learner->initialise(c.recording.sample(0), 3);
  count_allocations_anew();
  for (std::size_t k = 1; k < c.recording.samples; ++k) {
    learner->step(c.recording.sample(k));
    if (k % 100 == 0) {
      learner->finish();
      learner->get_values(values.data(), errors.data());
      learner->get_bias(bias.data(), nullptr);
    }
  }
  const long counted = counted_allocations();
  EXPECT_EQ(counted, 0);
  EXPECT_GT(errors[values.size() / 2] + values[0], 0.0);
#else
  GTEST_SKIP() << "allocations are counted with glibc, without sanitizers";
#endif
}

}  // namespace
