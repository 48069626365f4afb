// tendonfmu_estimation.h: what its calls give, on fingers whose truth is known, and what they refuse.
#include <algorithm>
#include <limits>

#include "made_recording.h"

namespace {

using made::Json;
using made::Numbers;

const double nan = std::numeric_limits<double>::quiet_NaN();

/* An estimator, destroyed with it. */
class Estimator {
 public:
  explicit Estimator(const Json& description) {
    const std::vector<unsigned char> image = made::image_of(description);
    char message[400] = "";
    handle_ = tendonfmu_estimator_create(image.data(), image.size(), nullptr, nullptr, message, sizeof message);
    EXPECT_NE(handle_, nullptr) << message;
  }
  ~Estimator() { tendonfmu_estimator_destroy(handle_); }
  Estimator(const Estimator&) = delete;
  Estimator& operator=(const Estimator&) = delete;

  tendonfmu_estimator* get() const { return handle_; }
  std::string error() const { return tendonfmu_estimator_last_error(handle_); }
  std::size_t unknowns() const { return tendonfmu_estimator_unknown_count(handle_); }
  std::size_t parameters() const { return tendonfmu_estimator_parameter_count(handle_); }
  tendonfmu_unknown unknown(std::size_t index) const {
    tendonfmu_unknown found = {};
    EXPECT_EQ(tendonfmu_estimator_get_unknown(handle_, index, &found), TENDONFMU_OK);
    return found;
  }
  Numbers start() const {
    Numbers z;
    for (std::size_t k = 0; k < unknowns(); ++k) {
      z.push_back(unknown(k).start);
    }
    return z;
  }
  tendonfmu_status add(const made::Recording& r, const tendonfmu_inputs& inputs) const {
    return tendonfmu_estimator_add_recording(handle_, r.samples, r.time.data(), &inputs, TENDONFMU_JOINT_VELOCITIES,
                                             r.load(), r.use.data(), nullptr);
  }
  tendonfmu_status add(const made::Recording& r) const { return add(r, r.inputs()); }

  double cost(const Numbers& z, Numbers* gradient = nullptr, Numbers* information = nullptr, unsigned threads = 1) {
    double found = nan;
    if (gradient) {
      gradient->assign(unknowns(), nan);
    }
    if (information) {
      information->assign(unknowns() * unknowns(), nan);
    }
    EXPECT_EQ(tendonfmu_estimator_evaluate(handle_, z.data(), 1, threads, &found, gradient ? gradient->data() : nullptr,
                                           information ? information->data() : nullptr),
              TENDONFMU_OK)
        << error();
    return found;
  }

 private:
  tendonfmu_estimator* handle_;
};

/* What a fit leaves. */
struct Fit {
  Numbers z, gradient, information, covariance;
  tendonfmu_fit_result result;
  tendonfmu_status status;

  Fit(const Estimator& e, const tendonfmu_fit_options& options, const double* start = nullptr,
      tendonfmu_fit_watch watch = nullptr, void* context = nullptr)
      : z(e.unknowns(), nan),
        gradient(z),
        information(z.size() * z.size(), nan),
        covariance(information),
        result{z.data(), gradient.data(), information.data(), covariance.data(), nan, nan, 0, 0, 0, 0},
        status(tendonfmu_estimator_fit(e.get(), start, &options, watch, context, &result)) {}
};

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
  Estimator e(c.guess);
  ASSERT_EQ(e.add(c.recording), TENDONFMU_OK) << e.error();
  ASSERT_EQ(e.add(d.recording), TENDONFMU_OK) << e.error();
  Numbers gradient, information, other_gradient, other_information;
  const double cost = e.cost(e.start(), &gradient, &information, 1);
  for (const unsigned threads : {2u, 3u, 64u}) {
    EXPECT_EQ(e.cost(e.start(), &other_gradient, &other_information, threads), cost);
    EXPECT_EQ(gradient, other_gradient);
    EXPECT_EQ(information, other_information);
  }
}

TEST(Estimator, FitFindsTheTruthToWithinItsErrors) {
  const Case c(25, 8000);
  Estimator e(c.guess), knows(c.truth);
  ASSERT_EQ(e.add(c.recording), TENDONFMU_OK) << e.error();
  tendonfmu_fit_options options = tendonfmu_default_fit_options();
  options.prior_std = 3.0;
  options.tolerance = 0.01;
  const Fit fit(e, options);
  ASSERT_EQ(fit.status, TENDONFMU_OK) << e.error();
  EXPECT_TRUE(fit.result.converged);
  EXPECT_FALSE(fit.result.stopped);
  const Numbers truth = knows.start();
  const std::size_t u = truth.size();
  double squares = 0.0;
  for (std::size_t k = 0; k < u; ++k) {
    const double error = std::sqrt(fit.covariance[k * u + k]);
    EXPECT_LT(std::fabs(fit.z[k] - truth[k]), 5.0 * error) << e.unknown(k).path;
    EXPECT_GE(fit.z[k], e.unknown(k).lower);
    EXPECT_LE(fit.z[k], e.unknown(k).upper);
    squares += (fit.z[k] - truth[k]) * (fit.z[k] - truth[k]) / (error * error) / static_cast<double>(u);
  }
  EXPECT_LT(squares, 2.5);
  Numbers gradient;
  EXPECT_DOUBLE_EQ(e.cost(fit.z, &gradient) + fit.result.prior_cost, fit.result.cost);
  EXPECT_EQ(gradient, fit.gradient);
  EXPECT_LT(e.cost(fit.z), e.cost(truth) + 1e-6 * fit.result.cost) << "the truth explains what is seen less well";
}

/* the joints' parts of the sums are weighted alone, and a weight of 1 changes no bit */
TEST(Estimator, WeightsScaleWhatEachJointAddsToTheSums) {
  const Case c(31, 2300);
  Estimator e(c.guess);
  ASSERT_EQ(e.add(c.recording), TENDONFMU_OK) << e.error();
  Numbers gradient[4], information[4];
  double cost[4];
  const auto look = [&](int at, double first, double second) {
    const double weight[2] = {first, second};
    EXPECT_EQ(tendonfmu_estimator_set_weights(e.get(), 0, weight), TENDONFMU_OK) << e.error();
    cost[at] = e.cost(e.start(), &gradient[at], &information[at]);
  };
  cost[0] = e.cost(e.start(), &gradient[0], &information[0]);
  look(1, 1.0, 1.0);
  EXPECT_EQ(cost[0], cost[1]);
  EXPECT_EQ(gradient[0], gradient[1]);
  EXPECT_EQ(information[0], information[1]);
  look(2, 0.25, 1.0);
  look(3, 1.0, 0.25);
  EXPECT_NEAR(cost[2] + cost[3], 1.25 * cost[0], 1e-12 * cost[0]);
  EXPECT_LT(std::max(cost[2], cost[3]), 0.99 * cost[0]);
  for (std::size_t k = 0; k < information[0].size(); ++k) {
    const std::size_t u = gradient[0].size();
    const double size = std::sqrt(information[0][(k / u) * (u + 1)] * information[0][(k % u) * (u + 1)]);
    ASSERT_NEAR(information[2][k] + information[3][k], 1.25 * information[0][k], 1e-10 * size);
  }
}

TEST(Estimator, AStoppedFitGivesTheBestSoFar) {
  const Case c(27, 4200);
  const Estimator e(c.guess);
  ASSERT_EQ(e.add(c.recording), TENDONFMU_OK) << e.error();
  const auto stop_at_zero = [](void* left, const tendonfmu_fit_progress*) {
    return (*static_cast<int*>(left))-- > 0 ? 1 : 0;
  };
  for (int asked = 0; asked < 2; ++asked) {
    int left = asked;
    const Fit some(e, tendonfmu_default_fit_options(), nullptr, stop_at_zero, &left);
    ASSERT_EQ(some.status, TENDONFMU_OK);
    EXPECT_TRUE(some.result.stopped);
    EXPECT_FALSE(some.result.converged);
    EXPECT_EQ(some.result.passes, static_cast<std::size_t>(asked));
    if (asked) {
      EXPECT_TRUE(std::isfinite(some.result.cost + some.gradient[0] + some.information[0] + some.covariance[0]));
    } else {
      EXPECT_EQ(some.z, e.start());
    }
  }
}

/* --- what they refuse -----------------------------------------------------------------------------------------------
 */

TEST(Estimator, RefusesRecordingsItCannotWeigh) {
  const Case c(29, 50);
  const Estimator e(c.truth);
  const auto why = [&](made::Recording r) {
    EXPECT_EQ(e.add(r), TENDONFMU_BAD_SAMPLE);
    return e.error();
  };
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
  tendonfmu_inputs none = c.recording.inputs();
  none.tendon_force = nullptr;
  EXPECT_EQ(e.add(c.recording, none), TENDONFMU_BAD_SAMPLE);
  Json silent = c.truth;
  silent["bias"]["noise_std"] = 0.0;
  const Estimator certain(silent);
  EXPECT_EQ(certain.add(c.recording), TENDONFMU_BAD_SAMPLE);
  EXPECT_EQ(certain.error().find("bias.noise_std = 0: expected above 0"), 0u);
  double cost;
  EXPECT_EQ(tendonfmu_estimator_evaluate(e.get(), e.start().data(), 1, 1, &cost, nullptr, nullptr),
            TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(e.error(), "no recording: expected at least one") << "none of the refused ones stayed";
  EXPECT_EQ(e.add(c.recording), TENDONFMU_OK) << e.error();
}

TEST(Estimator, RefusesArgumentsInOneLineThatSaysWhy) {
  const Case c(30, 50);
  const Estimator e(c.truth);
  ASSERT_EQ(e.add(c.recording), TENDONFMU_OK) << e.error();
  const auto said = [&](tendonfmu_status status) {
    EXPECT_EQ(status, TENDONFMU_BAD_ARGUMENT) << e.error();
    return e.error();
  };
  const Numbers start = e.start();
  const std::string path = e.unknown(1).path;
  Numbers values(e.parameters());
  for (const double wrong : {nan, -1.0, 1e12}) { /* outside its box */
    Numbers z = start;
    z[1] = wrong;
    EXPECT_EQ(tendonfmu_estimator_get_values(e.get(), z.data(), values.data()), TENDONFMU_BAD_PARAMETER);
    EXPECT_EQ(e.error().find("unknown 1 (" + path + ") = "), 0u) << e.error();
  }
  Numbers z = start;
  z[1] = nan;
  tendonfmu_fit_options options = tendonfmu_default_fit_options();
  EXPECT_EQ(said(Fit(e, options, z.data()).status).find("unknown 1 (" + path + ") = nan"), 0u) << e.error();
  options.prior_std = 0.0;
  EXPECT_EQ(said(Fit(e, options).status).find("prior_std = 0"), 0u) << e.error();
  EXPECT_EQ(said(tendonfmu_estimator_innovations(e.get(), 1, start.data(), nullptr, nullptr, nullptr)),
            "recording 1: expected below 1");
  tendonfmu_unknown unknown;
  said(tendonfmu_estimator_get_unknown(e.get(), start.size(), &unknown));
  const auto rows = [&](std::size_t first, std::size_t count) {
    return tendonfmu_estimator_jacobian(e.get(), 0, start.data(), first, count, 1, nullptr, nullptr, nullptr, nullptr);
  };
  said(rows(40, 11));
  said(rows(2, SIZE_MAX));
  EXPECT_EQ(rows(50, 0), TENDONFMU_OK);
  for (const double wrong : {0.0, -1.0, 1.5, nan}) {
    const double weight[2] = {1.0, wrong};
    EXPECT_NE(said(tendonfmu_estimator_set_weights(e.get(), 0, weight)).find("weight[2]"), std::string::npos);
  }
  for (const double wrong : {nan, -1.0}) {
    Numbers known(start.size() * start.size(), 0.0);
    known[0] = wrong;
    EXPECT_EQ(said(tendonfmu_estimator_set_known(e.get(), known.data())),
              "information: expected a symmetric, positive semidefinite matrix");
  }
}

TEST(Estimator, RefusesNullAndBadImages) {
  char message[200] = "";
  EXPECT_EQ(tendonfmu_estimator_create(nullptr, 0, nullptr, nullptr, message, sizeof message), nullptr);
  EXPECT_STREQ(message, "an argument is missing: NULL");
  EXPECT_EQ(tendonfmu_estimator_create("nonsense", 8, nullptr, nullptr, message, sizeof message), nullptr);
  EXPECT_STRNE(message, "an argument is missing: NULL");
  EXPECT_EQ(tendonfmu_estimator_create("nonsense", 8, nullptr, nullptr, nullptr, 0), nullptr);
  tendonfmu_estimator_destroy(nullptr);
  EXPECT_EQ(tendonfmu_estimator_unknown_count(nullptr), 0u);
  EXPECT_STREQ(tendonfmu_estimator_last_error(nullptr), "no estimator: NULL");
  const Estimator e(made::learnable_finger());
  const tendonfmu_fit_options options = tendonfmu_default_fit_options();
  tendonfmu_fit_result result = {};
  for (tendonfmu_estimator* each : {e.get(), static_cast<tendonfmu_estimator*>(nullptr)}) {
    for (const tendonfmu_status status :
         {tendonfmu_estimator_get_unknown(each, 0, nullptr), tendonfmu_estimator_get_values(each, nullptr, nullptr),
          tendonfmu_estimator_get_unknowns(each, nullptr, nullptr),
          tendonfmu_estimator_add_recording(each, 2, nullptr, nullptr, 1, nullptr, nullptr, nullptr),
          tendonfmu_estimator_set_weights(each, 0, nullptr),
          tendonfmu_estimator_evaluate(each, nullptr, 1, 1, nullptr, nullptr, nullptr),
          tendonfmu_estimator_fit(each, nullptr, &options, nullptr, nullptr, &result)}) {
      EXPECT_EQ(status, TENDONFMU_BAD_ARGUMENT);
    }
  }
  EXPECT_EQ(e.error(), "an argument is missing: NULL");
}

}  // namespace
