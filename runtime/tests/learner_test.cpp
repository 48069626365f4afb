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

double root_mean_square(const Numbers& numbers) {
  double sum = 0.0;
  for (const double x : numbers) {
    sum += x * x;
  }
  return std::sqrt(sum / static_cast<double>(numbers.size()));
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

TEST(Learner, AgreesWithTheBatch) {
  const Case c(5, 20000);
  Learner learner(c.description);
  learner.run(c.recording);
  const std::vector<unsigned char> image = made::image_of(c.description);
  char message[400] = "";
  tendonfmu_estimator* e =
      tendonfmu_estimator_create(image.data(), image.size(), nullptr, nullptr, message, sizeof message);
  ASSERT_NE(e, nullptr) << message;
  const tendonfmu_inputs inputs = c.recording.inputs();
  ASSERT_EQ(tendonfmu_estimator_add_recording(e, c.recording.samples, c.recording.time.data(), &inputs,
                                              TENDONFMU_JOINT_VELOCITIES, c.recording.load(), nullptr, nullptr),
            TENDONFMU_OK);
  const std::size_t u = learner.unknowns();
  Numbers z(u), covariance(u * u);
  tendonfmu_fit_options options = tendonfmu_default_fit_options();
  options.prior_std = 1.0;
  tendonfmu_fit_result result = {};
  result.z = z.data();
  result.covariance = covariance.data();
  EXPECT_EQ(tendonfmu_estimator_fit(e, nullptr, &options, nullptr, nullptr, &result), TENDONFMU_OK);
  tendonfmu_estimator_destroy(e);
  /* one pass, linearised on the way; then both are at the same maximum */
  EXPECT_LT(root_mean_square(normalised(learner, z)), 0.5);
  EXPECT_LT(largest(normalised(learner, z)), 2.0);
  learner.run_again(c.recording);
  EXPECT_LT(root_mean_square(normalised(learner, z)), 0.1);
  EXPECT_LT(largest(normalised(learner, z)), 0.4);
}

TEST(Learner, BlocksStayWithinAPartOfAStandardError) {
  const Case c(6, 5000); /* 10 s */
  Learner exact(c.description, 1), blocks(c.description, 8);
  exact.run(c.recording);
  blocks.run(c.recording);
  const Numbers apart = normalised(blocks, exact.z());
  EXPECT_GT(largest(apart), 0.0);
  EXPECT_LT(root_mean_square(apart), 0.3);
  EXPECT_LT(largest(apart), 1.5);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_NEAR(exact.bias()[j], blocks.bias()[j], 1e-3); /* standard error: 2.5e-3 */
  }
}

TEST(Learner, WithNothingUnknownItIsTheBiasFilterOfTheCore) {
  Json description = made::learnable_finger();
  description["contact"] = {{"threshold", {1e6, 1e6}}};
  const Recording r = made::moved(2, 2, 2001, 0.002, 40);
  const std::vector<unsigned char> image = made::image_of(description);
  tendonfmu_finger* finger = tendonfmu_create(image.data(), image.size(), nullptr, 0);
  ASSERT_NE(finger, nullptr);
  tendonfmu_set_kinematics_source(finger, TENDONFMU_JOINT_VELOCITIES);
  Numbers bias(r.samples * 2);
  tendonfmu_outputs outputs = {};
  outputs.bias_torque = bias.data();
  const tendonfmu_inputs inputs = r.inputs();
  ASSERT_EQ(tendonfmu_run(finger, r.samples, r.time.data(), &inputs, &outputs, nullptr), TENDONFMU_OK);
  const std::vector<std::int32_t> fixed(tendonfmu_parameter_count(finger), -1);
  tendonfmu_destroy(finger);
  for (const std::size_t block : {std::size_t{1}, std::size_t{8}}) {
    const tendonfmu_learner_options options = {1.0, block, 0.0};
    tendonfmu_learner* l =
        tendonfmu_learner_create(image.data(), image.size(), fixed.data(), nullptr, &options, nullptr, 0);
    ASSERT_NE(l, nullptr);
    EXPECT_EQ(tendonfmu_learner_unknown_count(l), 0u);
    for (std::size_t k = 0; k < r.samples; ++k) {
      const tendonfmu_inputs row = r.inputs(k);
      ASSERT_EQ(k == 0 ? tendonfmu_learner_initialise(l, r.time[0], &row, 3, nullptr, 1)
                       : tendonfmu_learner_step(l, r.time[k], &row, nullptr, 1),
                TENDONFMU_OK);
      if (k % block == 0) {
        Numbers found(2);
        ASSERT_EQ(tendonfmu_learner_get_bias(l, found.data(), nullptr), TENDONFMU_OK);
        ASSERT_NEAR(found[0], bias[2 * k], 1e-12) << k;
        ASSERT_NEAR(found[1], bias[2 * k + 1], 1e-12) << k;
      }
    }
    tendonfmu_learner_destroy(l);
  }
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

TEST(Learner, EstimatesTheInitialTorque) {
  Json description = made::learnable_finger();
  description["bias"]["initial_torque"] = {0.0, 0.0};
  description["bias"]["initial_variance"] = 1e-8;
  Json truth = description;
  truth["bias"]["initial_torque"] = {0.4, -0.3};
  const Recording r = made::made(truth, 6000, 0.002, 9);
  Learner learner(description);
  learner.run(r);
  std::size_t found = 0;
  const Numbers z = learner.z(), covariance = learner.covariance();
  for (std::size_t i = 0; i < learner.unknowns(); ++i) {
    const std::string path = learner.unknown(i).path;
    if (path.find("initial_torque") != std::string::npos) {
      const double expected = path.find("[1]") != std::string::npos ? 0.4 : -0.3;
      const double error = std::sqrt(covariance[i * learner.unknowns() + i]);
      EXPECT_LT(error, 0.1);
      EXPECT_NEAR(z[i], expected, 4.0 * error);
      ++found;
    }
  }
  EXPECT_EQ(found, 2u);
}

TEST(Learner, KeepsUnknownsFromOneRecordingToTheNext) {
  const Case c(10, 4000);
  const Recording second = made::made(c.truth, 4000, 0.001, 77);
  Learner both(c.description), one(c.description);
  one.run(c.recording);
  both.run(c.recording);
  both.run(second);
  EXPECT_TRUE(std::isnan(both.innovation[0]));
  const Numbers before = one.covariance(), after = both.covariance();
  for (std::size_t i = 0; i < one.unknowns(); ++i) {
    const std::size_t at = i * one.unknowns() + i;
    EXPECT_LE(after[at], before[at] * (1.0 + 1e-12));
  }
  EXPECT_LT(largest(normalised(both, made::truth_of(c.truth))), 4.0);
}

TEST(Learner, GivesNumbersOfTheDescriptionWithTheirErrors) {
  const Case c(11, 2000);
  Learner learner(c.description);
  learner.run(c.recording);
  const std::size_t p = tendonfmu_learner_parameter_count(learner.get()), u = learner.unknowns();
  Numbers values(p), errors(p);
  ASSERT_EQ(tendonfmu_learner_get_values(learner.get(), values.data(), errors.data()), TENDONFMU_OK);
  const Numbers z = learner.z(), covariance = learner.covariance();
  std::vector<bool> moved(p, false);
  for (std::size_t i = 0; i < u; ++i) {
    const tendonfmu_unknown unknown = learner.unknown(i);
    const std::size_t parameter = unknown.parameters[0];
    const double error = std::sqrt(covariance[i * u + i]);
    moved[parameter] = true;
    if (unknown.role == TENDONFMU_DROP) {
      EXPECT_DOUBLE_EQ(values[parameter], values[parameter + 1] + z[i]);
      EXPECT_GT(errors[parameter], 0.0);
      EXPECT_NE(errors[parameter], error); /* of static, not of the drop */
    } else if (unknown.role == TENDONFMU_RATE) {
      EXPECT_DOUBLE_EQ(values[parameter], 1.0 / z[i]);
      EXPECT_NEAR(errors[parameter], error / (z[i] * z[i]), 1e-9 * errors[parameter]);
    } else {
      EXPECT_DOUBLE_EQ(values[parameter], z[i]);
      EXPECT_DOUBLE_EQ(errors[parameter], error);
    }
  }
  for (std::size_t k = 0; k < p; ++k) {
    EXPECT_EQ(errors[k] > 0.0, moved[k]) << k;
  }
}

TEST(Learner, CountsAndLeavesOutSlackSamples) {
  Case c(12, 1000);
  Learner whole(c.description), without(c.description);
  whole.run(c.recording);
  EXPECT_EQ(tendonfmu_learner_slack_samples(whole.get()), 0u);
  Recording slack = c.recording;
  for (std::size_t k = 500; k < 520; ++k) {
    slack.force[2 * k] = -1.0;
  }
  without.run(slack);
  EXPECT_EQ(tendonfmu_learner_slack_samples(without.get()), 20u);
  for (std::size_t k = 500; k < 520; ++k) {
    slack.external[2 * k] = 1e3;
    slack.use[k] = 0;
  }
  Learner unused(c.description);
  unused.run(slack);
  EXPECT_EQ(unused.z(), without.z());
  EXPECT_EQ(tendonfmu_learner_slack_samples(unused.get()), 0u);
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
  EXPECT_EQ(tendonfmu_learner_unknown_count(nullptr), 0u);
  EXPECT_EQ(tendonfmu_learner_slack_samples(nullptr), 0u);
  EXPECT_STREQ(tendonfmu_learner_last_error(nullptr), "no learner: NULL");
  EXPECT_EQ(tendonfmu_learner_create(nullptr, 0, nullptr, nullptr, nullptr, nullptr, 0), nullptr);
  EXPECT_EQ(tendonfmu_learner_initialise(nullptr, 0.0, nullptr, 1, nullptr, 1), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_learner_step(nullptr, 0.0, nullptr, nullptr, 1), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_learner_finish(nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_learner_get_values(nullptr, nullptr, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_learner_get_unknowns(nullptr, nullptr, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_learner_get_bias(nullptr, nullptr, nullptr), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_learner_get_innovations(nullptr, nullptr, nullptr, nullptr), TENDONFMU_BAD_ARGUMENT);
}

TEST(Learner, StepAllocatesNothing) {
#if defined(COUNTS_ALLOCATIONS)
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
