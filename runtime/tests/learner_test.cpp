// tendonfmu_learner.h on recordings whose truth is known.
#include <limits>

#include "allocation_count.h"
#include "made_recording.h"

namespace {

using made::Json;
using made::Learner;
using made::Numbers;
using made::Recording;

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
        EXPECT_LT(std::fabs(z[i] - truth[i]), 4.0 * error[i]) << seed << " " << learner.unknown(i).path;
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
  tendonfmu_learner* l = steps.get();
  Numbers innovation(c.recording.samples * 2, std::nan("")), last(16), last_variance(16);
  for (std::size_t k = 0; k < c.recording.samples; ++k) {
    const tendonfmu_inputs inputs = c.recording.inputs(k);
    const tendonfmu_status status =
        k == 0 ? tendonfmu_learner_initialise(l, c.recording.time[0], &inputs, 3, c.recording.load(0), 1)
               : tendonfmu_learner_step(l, c.recording.time[k], &inputs, c.recording.load(k), 1);
    ASSERT_EQ(status, TENDONFMU_OK) << tendonfmu_learner_last_error(l);
    if (k > 0) { /* the same time again: nothing */
      ASSERT_EQ(tendonfmu_learner_step(l, c.recording.time[k], &inputs, nullptr, 1), TENDONFMU_OK);
    }
    std::size_t count = 0;
    if (k > 0 && k % 8 == 0) {
      ASSERT_EQ(tendonfmu_learner_get_innovations(l, &count, last.data(), last_variance.data()), TENDONFMU_OK);
      ASSERT_EQ(count, 8u);
      std::copy(last.begin(), last.end(), innovation.begin() + static_cast<std::ptrdiff_t>(2 * (k - 7)));
    }
  }
  ASSERT_EQ(tendonfmu_learner_finish(l), TENDONFMU_OK);
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
  tendonfmu_learner* l = teased.get();
  const double nothing = std::nan(""), load[] = {0.0, std::numeric_limits<double>::infinity()};
  const Numbers no_force(2, nothing);
  tendonfmu_inputs inputs = c.recording.inputs(0);
  EXPECT_EQ(tendonfmu_learner_step(l, 0.0, &inputs, nullptr, 1), TENDONFMU_WRONG_ORDER);
  EXPECT_EQ(tendonfmu_learner_get_bias(l, nullptr, nullptr), TENDONFMU_WRONG_ORDER);
  ASSERT_EQ(tendonfmu_learner_initialise(l, c.recording.time[0], &inputs, 3, c.recording.load(0), 1), TENDONFMU_OK);
  for (std::size_t k = 1; k < c.recording.samples; ++k) {
    inputs = c.recording.inputs(k);
    tendonfmu_inputs bad = inputs;
    bad.tendon_force = no_force.data();
    const double time = c.recording.time[k];
    ASSERT_EQ(tendonfmu_learner_step(l, time, &bad, nullptr, 1), TENDONFMU_BAD_SAMPLE);
    ASSERT_EQ(tendonfmu_learner_step(l, time, &inputs, load, 1), TENDONFMU_BAD_SAMPLE);
    ASSERT_EQ(tendonfmu_learner_step(l, time - 1.0, &inputs, nullptr, 1), TENDONFMU_BAD_SAMPLE);
    ASSERT_EQ(tendonfmu_learner_step(l, time, &inputs, c.recording.load(k), 1), TENDONFMU_OK);
  }
  ASSERT_EQ(tendonfmu_learner_finish(l), TENDONFMU_OK);
  EXPECT_EQ(clean.z(), teased.z());
  EXPECT_EQ(clean.covariance(), teased.covariance());
}

TEST(Learner, SaysWhyItRefuses) {
  const auto reason = [](const Json& description, tendonfmu_learner_options options) {
    const std::vector<unsigned char> image = made::image_of(description);
    char message[400] = "";
    tendonfmu_learner* l =
        tendonfmu_learner_create(image.data(), image.size(), nullptr, nullptr, &options, message, sizeof message);
    EXPECT_EQ(l, nullptr);
    return std::string(message);
  };
  const Json good = made::learnable_finger();
  EXPECT_EQ(reason(good, {0.0, 8, 0.0}), "prior_std = 0.000000: expected above 0, at most 1e6 scales");
  EXPECT_EQ(reason(good, {1.0, 0, 0.0}), "block = 0: expected 1 to 64 samples");
  EXPECT_EQ(reason(good, {1.0, 65, 0.0}), "block = 65: expected 1 to 64 samples");
  EXPECT_EQ(reason(good, {1.0, 8, -1.0}), "parameter_drift = -1.000000: expected 0 to 1e6 1/s");
  Json silent = good;
  silent["bias"]["noise_std"] = 0.0;
  EXPECT_EQ(reason(silent, {1.0, 8, 0.0}),
            "bias.noise_std = 0: expected above 0 N.m to learn, which weighs the residuals by it");

  Case c(14, 5);
  Learner learner(good);
  c.recording.time[3] = c.recording.time[2];
  const tendonfmu_inputs inputs = c.recording.inputs();
  std::size_t done = 7;
  EXPECT_EQ(tendonfmu_learner_run(learner.get(), 5, c.recording.time.data(), &inputs, 3, nullptr, nullptr, nullptr,
                                  nullptr, nullptr, nullptr, &done),
            TENDONFMU_BAD_SAMPLE);
  EXPECT_EQ(done, 3u);
  EXPECT_STREQ(tendonfmu_learner_last_error(learner.get()), "row 4: time: expected later than the row before");
  EXPECT_EQ(tendonfmu_learner_run(learner.get(), 1, c.recording.time.data(), &inputs, 3, nullptr, nullptr, nullptr,
                                  nullptr, nullptr, nullptr, &done),
            TENDONFMU_BAD_SAMPLE);
  EXPECT_STREQ(tendonfmu_learner_last_error(learner.get()), "samples = 1: expected at least 2");
  EXPECT_EQ(tendonfmu_learner_initialise(learner.get(), 0.0, &inputs, 4, nullptr, 1), TENDONFMU_BAD_ARGUMENT);
}

TEST(Learner, StopsWhenTheWatchSaysSo) {
  const Case c(15, 3000);
  Learner learner(c.description);
  const tendonfmu_inputs inputs = c.recording.inputs();
  std::size_t done = 0;
  const auto watch = [](void*, std::size_t row, std::size_t) { return row < 1000 ? 1 : 0; };
  EXPECT_EQ(tendonfmu_learner_run(learner.get(), 3000, c.recording.time.data(), &inputs, 3, c.recording.load(), nullptr,
                                  nullptr, nullptr, watch, nullptr, &done),
            TENDONFMU_OK);
  EXPECT_EQ(done, 1001u);
}

TEST(Learner, TakesNoLearner) {
  tendonfmu_learner_destroy(nullptr);
  EXPECT_EQ(tendonfmu_learner_unknown_count(nullptr) + tendonfmu_learner_slack_samples(nullptr), 0u);
  EXPECT_STREQ(tendonfmu_learner_last_error(nullptr), "no learner: NULL");
  EXPECT_EQ(tendonfmu_learner_create(nullptr, 0, nullptr, nullptr, nullptr, nullptr, 0), nullptr);
  for (const tendonfmu_status status :
       {tendonfmu_learner_initialise(nullptr, 0.0, nullptr, 1, nullptr, 1),
        tendonfmu_learner_step(nullptr, 0.0, nullptr, nullptr, 1), tendonfmu_learner_finish(nullptr),
        tendonfmu_learner_get_values(nullptr, nullptr, nullptr),
        tendonfmu_learner_get_unknowns(nullptr, nullptr, nullptr),
        tendonfmu_learner_get_bias(nullptr, nullptr, nullptr),
        tendonfmu_learner_get_innovations(nullptr, nullptr, nullptr, nullptr)}) {
    EXPECT_EQ(status, TENDONFMU_BAD_ARGUMENT);
  }
}

TEST(Learner, StepAllocatesNothing) {
#if defined(COUNTS_ALLOCATIONS)
  ASSERT_TRUE(allocations_count());
  const Case c(16, 2000);
  Learner learner(c.description);
  tendonfmu_learner* l = learner.get();
  Numbers values(tendonfmu_learner_parameter_count(l)), errors = values, bias(2);
  for (std::size_t k = 0; k < c.recording.samples; ++k) {
    const tendonfmu_inputs inputs = c.recording.inputs(k);
    if (k == 0) {
      tendonfmu_learner_initialise(l, c.recording.time[0], &inputs, 3, c.recording.load(0), 1);
      count_allocations_anew();
      continue;
    }
    tendonfmu_learner_step(l, c.recording.time[k], &inputs, c.recording.load(k), 1);
    if (k % 100 == 0) {
      tendonfmu_learner_finish(l);
      tendonfmu_learner_get_values(l, values.data(), errors.data());
      tendonfmu_learner_get_bias(l, bias.data(), nullptr);
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
