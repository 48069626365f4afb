// Recordings that the model explains exactly, with a known truth, and fingers that do not know it yet.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "described_finger.h"
#include "tendonfmu_estimation.hpp"

namespace made {

using Json = nlohmann::json;
using Numbers = std::vector<double>;
using tendonfmu::estimation::estimator;
using tendonfmu::estimation::recording_arrays;

inline std::vector<unsigned char> image_of(const Json& description) {
  const Reading reading = read(description);
  EXPECT_EQ(reading.status, TENDONFMU_OK) << reading.message;
  return reading.image;
}

/* two joints, two tendons; every kind of law, all of them with every number */
inline Json learnable_finger() {
  Json finger = small_finger();
  finger["joints"][1]["friction"] = finger["joints"][0]["friction"];
  finger["tendons"][0]["edge_friction"][1]["laws"][0]["viscous"] = 0.3;
  finger["tendons"][0]["edge_friction"][1]["laws"][1]["viscous"] = 0.2;
  finger["tendons"][1]["edge_friction"] = {finger["tendons"][0]["pulley_friction"][0], nullptr};
  finger.erase("extensions");
  finger["bias"] = {{"drift_variance", 1e-5}, {"noise_std", 0.004}, {"initial_variance", 1e-4}, {"forget_rate", 4}};
  return finger;
}

/* every number of every law times e^(spread·N(0, 1)), static friction staying above coulomb */
inline Json disturbed(Json node, double spread, std::mt19937_64* random) {
  if (node.is_object() && node.contains("coulomb")) {
    const auto factor = [&] { return std::exp(spread * std::normal_distribution<double>()(*random)); };
    const double coulomb = node["coulomb"], still = node["static"], speed = node.value("stribeck_velocity", 0.0);
    node["coulomb"] = coulomb * factor();
    node["static"] = node["coulomb"].get<double>() + (still - coulomb) * factor();
    node["stribeck_velocity"] = speed * factor();
    node["viscous"] = node.value("viscous", 0.0) * factor();
    return node;
  }
  for (auto& child : node) {
    if (child.is_structured()) {
      child = disturbed(child, spread, random);
    }
  }
  return node;
}

struct Recording {
  std::size_t samples, joints, tendons;
  Numbers time, force, angle, velocity, external, bias;
  std::vector<unsigned char> use;
  double noise_square = 0.0; /* mean of e²/R as it was drawn */

  tendonfmu_inputs inputs(std::size_t row = 0) const {
    return {force.data() + row * tendons, nullptr, angle.data() + row * joints, velocity.data() + row * joints};
  }
  const double* load(std::size_t row = 0) const { return external.data() + row * joints; }
  recording_arrays arrays() const {
    return {samples, time.data(), inputs(), load(), use.data(), TENDONFMU_JOINT_VELOCITIES};
  }
  tendonfmu::estimation::learner_sample sample(std::size_t row) const {
    return {time[row], inputs(row), load(row), use[row] != 0};
  }
};

/* sums of sines with changes of direction at all speeds, forces that differ between the tendons and vary */
inline Recording moved(std::size_t joints, std::size_t tendons, std::size_t samples, double step, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Recording r{samples, joints, tendons, Numbers(samples), Numbers(samples * tendons), {}, {}, {}, {}, {}};
  r.angle = r.velocity = r.external = r.bias = Numbers(samples * joints);
  r.use.assign(samples, 1);
  for (std::size_t k = 0; k < samples; ++k) {
    r.time[k] = step * static_cast<double>(k);
  }
  for (int wave = 0; wave < 3; ++wave) {
    for (std::size_t j = 0; j < joints; ++j) {
      const double rate = 0.4 + 5.0 * uniform(random) * uniform(random), size = 0.5 / (1.0 + rate),
                   phase = 6.3 * uniform(random);
      for (std::size_t k = 0; k < samples; ++k) {
        r.angle[k * joints + j] += size * std::sin(rate * r.time[k] + phase);
        r.velocity[k * joints + j] += size * rate * std::cos(rate * r.time[k] + phase);
      }
    }
    for (std::size_t i = 0; i < tendons; ++i) {
      const double rate = 0.3 + 3.0 * uniform(random), size = 2.5 + 5.0 * uniform(random),
                   phase = 6.3 * uniform(random);
      for (std::size_t k = 0; k < samples; ++k) {
        r.force[k * tendons + i] += 10.0 + size * std::sin(rate * r.time[k] + phase);
      }
    }
  }
  return r;
}

inline estimator estimator_of(const Json& description) {
  const std::vector<unsigned char> image = image_of(description);
  return {image.data(), image.size()};
}

/* T and Δb [samples × n] of the description over the motion, by the estimation's own look at the core */
inline std::pair<Numbers, Numbers> torques(const Json& description, const Recording& r) {
  estimator e = estimator_of(description);
  e.add_recording({r.samples, r.time.data(), r.inputs(), nullptr, nullptr, TENDONFMU_JOINT_VELOCITIES});
  const estimator::block_means means = e.jacobian(0, e.start(), 0, r.samples, 1);
  return {means.torque, means.jump};
}

/* Makes external_torque so that y = τ − external_torque is what the model says: T + b + e, with the walk and the noise
 * of the description. y = Rᵀ f0 − external_torque needs τ: by the moment arms. */
inline void explain(const Json& description, Recording* r, unsigned seed) {
  const auto [torque, jump] = torques(description, *r);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const Json& bias = description["bias"];
  const double drift = bias["drift_variance"], first = bias["initial_variance"];
  Numbers b(r->joints, 0.15);
  if (bias.contains("initial_torque")) {
    b = bias["initial_torque"].get<Numbers>();
  }
  for (std::size_t k = 0; k < r->samples; ++k) {
    double mean_force = 0.0;
    for (std::size_t i = 0; i < r->tendons; ++i) {
      mean_force += std::fabs(r->force[k * r->tendons + i]) / static_cast<double>(r->tendons);
    }
    double noise = bias["noise_std"].get<double>() + bias.value("noise_std_per_force", 0.0) * mean_force;
    const double step = k > 0 ? r->time[k] - r->time[k - 1] : 0.0;
    if (bias.contains("noise_time") && k > 0) {
      noise *= std::sqrt(bias["noise_time"].get<double>() / step);
    }
    for (std::size_t j = 0; j < r->joints; ++j) {
      const std::size_t at = k * r->joints + j;
      b[j] += k > 0 ? jump[at] + std::sqrt(drift * step) * normal(random) : std::sqrt(first) * normal(random);
      double measured = 0.0;
      for (std::size_t i = 0; i < r->tendons; ++i) {
        measured += description["tendons"][i]["moment_arms"][j].get<double>() * r->force[k * r->tendons + i];
      }
      /* the first sample: its error is the bias' own, above */
      const double e = k > 0 ? normal(random) : 0.0;
      r->external[at] = measured - (torque[at] + b[j] + noise * e);
      r->noise_square += e * e / static_cast<double>((r->samples - 1) * r->joints);
      r->bias[at] = b[j];
    }
  }
}

inline Recording made(const Json& description, std::size_t samples, double step, unsigned seed) {
  Recording r = moved(description["joints"].size(), description["tendons"].size(), samples, step, seed);
  explain(description, &r, seed + 1000);
  return r;
}

/* A learner and what its last run left. */
class Learner {
 public:
  explicit Learner(const Json& description) {
    const std::vector<unsigned char> image = image_of(description);
    learner_ = tendonfmu::estimation::make_learner(image.data(), image.size());
  }

  tendonfmu::estimation::learner* operator->() const { return learner_.get(); }
  std::size_t unknowns() const { return learner_->unknowns().size(); }

  void run(const Recording& r) {
    innovation.assign(r.samples * r.joints, 0.0);
    variance = innovation;
    ASSERT_EQ(learner_->run(r.arrays(), innovation.data(), variance.data()), r.samples);
  }

  /* linearised anew, twice, where the pass before arrived */
  void run_again(const Recording& r) {
    for (int pass = 2; pass <= 3; ++pass) {
      learner_->begin_pass();
      run(r);
    }
  }

  Numbers z() const {
    Numbers z(unknowns());
    learner_->get_unknowns(z.data(), nullptr);
    return z;
  }
  Numbers covariance() const {
    Numbers matrix(unknowns() * unknowns());
    learner_->get_unknowns(nullptr, matrix.data());
    return matrix;
  }
  Numbers bias() const {
    Numbers bias(learner_->joint_count());
    learner_->get_bias(bias.data(), nullptr);
    return bias;
  }

  Numbers innovation, variance;

 private:
  std::unique_ptr<tendonfmu::estimation::learner> learner_;
};

/* the line that a refusal says; nothing where nothing is refused */
template <typename Call>
std::string refusal(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& reason) {
    return reason.what();
  }
  return "";
}

/* z of a description, as the learner's unknowns have it */
inline Numbers truth_of(const Json& description) {
  return estimator_of(description).start();
}

/* Σ innovation²/variance over the samples from `first` on, divided by their number */
inline double mean_square(const Learner& learner, std::size_t first) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t k = first; k < learner.innovation.size(); ++k) {
    if (std::isfinite(learner.innovation[k])) {
      sum += learner.innovation[k] * learner.innovation[k] / learner.variance[k];
      ++count;
    }
  }
  return sum / static_cast<double>(count);
}

}  // namespace made
