/* The C interface of the batch, tendonfmu_estimation.h. */
#include "tendonfmu_estimation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>

#include "batch.h"
#include "c_interface.h"
#include "sample_rows.h"

using namespace tendonfmu::estimation;

struct tendonfmu_estimator {
  tendonfmu_estimator(const void* image, std::size_t size, const std::int32_t* group, const double* scale)
      : problem(image, size, group, scale) {}
  fit_problem problem;
  mutable std::string error;
};

namespace {

/* unknowns within their boxes, up to rounding */
std::vector<double> checked(const fit_problem& problem, const double* z) {
  std::vector<double> values(z, z + problem.unknowns.count());
  for (std::size_t k = 0; k < values.size(); ++k) {
    const unknown_item& u = problem.unknowns[k];
    const double slack = 1e-9 * u.scale;
    if (!(values[k] >= u.lower - slack && values[k] <= u.upper + slack)) {
      char text[200];
      std::snprintf(text, sizeof text, "unknown %zu (%s) = %g: expected %g to %g", k, u.path.c_str(), values[k],
                    u.lower, u.upper);
      throw refused(text);
    }
    values[k] = std::min(std::max(values[k], u.lower), u.upper);
  }
  return values;
}

void known_recording(const fit_problem& problem, std::size_t recording) {
  if (recording >= problem.recordings.size()) {
    throw refused("recording " + std::to_string(recording) + ": expected below " +
                  std::to_string(problem.recordings.size()));
  }
}

/* [u × u] symmetric, positive semidefinite up to rounding */
Eigen::MatrixXd checked_information(const double* information, Eigen::Index u) {
  const Eigen::MatrixXd given = Eigen::Map<const Eigen::MatrixXd>(information, u, u);
  if (u == 0) {
    return {};
  }
  const Eigen::VectorXd size = given.diagonal().cwiseAbs().cwiseSqrt().cwiseMax(1e-150).cwiseInverse();
  const Eigen::MatrixXd unit = size.asDiagonal() * given * size.asDiagonal();
  if (!unit.allFinite() || (unit - unit.transpose()).cwiseAbs().maxCoeff() > 1e-6 ||
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(unit).eigenvalues()[0] < -1e-6) {
    throw refused("information: expected a symmetric, positive semidefinite matrix");
  }
  return 0.5 * (given + given.transpose());
}

/* the finger over the samples of a recording from `first` on, with a call after each */
template <typename Body>
void replay(tendonfmu_estimator* estimator, std::size_t recording, const std::vector<double>& z, std::size_t first,
            std::size_t count, free_finger* finger, const Body& body) {
  const fit_problem& problem = estimator->problem;
  known_recording(problem, recording);
  const recording_track& r = problem.recordings[recording];
  if (first > r.samples() || count > r.samples() - first) {
    throw refused("samples up to " + std::to_string(first + count) + ": expected at most " +
                  std::to_string(r.samples()));
  }
  if (count == 0) {
    return;
  }
  const std::size_t segment = remembers_numbers(finger->get()) ? 0 : first / r.segment_length();
  const std::vector<double> numbers = problem.unknowns.write(z.data());
  if (segment > 0) {
    finger->resume(r.states()[segment], numbers);
  } else {
    finger->begin(numbers, r.kinematics_source());
  }
  for (std::size_t k = segment * r.segment_length(); k < first + count; ++k) {
    finger->step(k, r.time(k), r.inputs(k));
    if (k >= first) {
      body(r, k);
    }
  }
}

void put(double* to, std::size_t at, double value) {
  if (to) {
    to[at] = value;
  }
}

/* the scalar bias filter of one joint */
struct bias_filter {
  double bias = 0.0;
  bool started = false;

  double take(double torque, double jump, double gain, bool starts) {
    bias += jump;
    if (starts) {
      bias = torque;
      started = true;
    }
    const double innovation = torque - bias;
    bias += gain * innovation;
    return innovation;
  }
};

}  // namespace

extern "C" {

tendonfmu_estimator* tendonfmu_estimator_create(const void* image, size_t image_size, const int32_t* group,
                                                const double* scale, char* message, size_t message_size) {
  return created(image, message, message_size,
                 [&] { return new tendonfmu_estimator(image, image_size, group, scale); });
}

void tendonfmu_estimator_destroy(tendonfmu_estimator* estimator) {
  delete estimator;
}

const char* tendonfmu_estimator_last_error(const tendonfmu_estimator* estimator) {
  return estimator ? estimator->error.c_str() : "no estimator: NULL";
}

size_t tendonfmu_estimator_joint_count(const tendonfmu_estimator* estimator) {
  return estimator ? estimator->problem.joints() : 0;
}
size_t tendonfmu_estimator_tendon_count(const tendonfmu_estimator* estimator) {
  return estimator ? estimator->problem.finger.get()->tendons : 0;
}
size_t tendonfmu_estimator_parameter_count(const tendonfmu_estimator* estimator) {
  return estimator ? estimator->problem.finger.get()->shape.parameter_count : 0;
}
size_t tendonfmu_estimator_unknown_count(const tendonfmu_estimator* estimator) {
  return estimator ? estimator->problem.unknowns.count() : 0;
}

tendonfmu_status tendonfmu_estimator_get_unknown(const tendonfmu_estimator* estimator, size_t index,
                                                 tendonfmu_unknown* unknown) {
  if (!estimator || !unknown) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return describe_unknown(estimator, estimator->problem.unknowns, index, unknown);
}

tendonfmu_status tendonfmu_estimator_get_values(const tendonfmu_estimator* estimator, const double* z, double* values) {
  if (!estimator || !z || !values) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_PARAMETER, [&] {
    const std::vector<double> numbers = estimator->problem.unknowns.write(checked(estimator->problem, z).data());
    std::copy(numbers.begin(), numbers.end(), values);
  });
}

tendonfmu_status tendonfmu_estimator_get_unknowns(const tendonfmu_estimator* estimator, const double* values,
                                                  double* z) {
  if (!estimator || !z || !values) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_PARAMETER, [&] {
    const std::vector<double> unknowns = estimator->problem.unknowns.read(values);
    std::copy(unknowns.begin(), unknowns.end(), z);
  });
}

tendonfmu_status tendonfmu_estimator_add_recording(tendonfmu_estimator* estimator, size_t samples, const double* time,
                                                   const tendonfmu_inputs* inputs, int kinematics_source,
                                                   const double* external_torque, const unsigned char* use,
                                                   size_t* index) {
  if (!estimator || !time || !inputs) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_SAMPLE, [&] {
    fit_problem& problem = estimator->problem;
    problem.recordings.emplace_back(&problem.finger,
                                    recording_arrays{samples, time, *inputs, external_torque, use, kinematics_source});
    if (index) {
      *index = problem.recordings.size() - 1;
    }
  });
}

tendonfmu_status tendonfmu_estimator_set_weights(tendonfmu_estimator* estimator, size_t recording,
                                                 const double* weight) {
  if (!estimator || !weight) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_ARGUMENT, [&] {
    known_recording(estimator->problem, recording);
    estimator->problem.recordings[recording].set_weights(weight);
  });
}

tendonfmu_status tendonfmu_estimator_set_known(tendonfmu_estimator* estimator, const double* information) {
  if (!estimator) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  return guarded(estimator, TENDONFMU_BAD_ARGUMENT, [&] {
    const auto u = static_cast<Eigen::Index>(estimator->problem.unknowns.count());
    estimator->problem.known = checked_information(information, information ? u : 0);
  });
}

tendonfmu_status tendonfmu_estimator_evaluate(tendonfmu_estimator* estimator, const double* z, size_t stride,
                                              unsigned threads, double* cost, double* gradient, double* information) {
  if (!estimator || !z) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_ARGUMENT, [&] {
    const std::size_t every = std::max<std::size_t>(stride, 1);
    const cost_evaluation found = evaluate(estimator->problem, checked(estimator->problem, z), {every, threads}, {});
    put(cost, 0, found.cost);
    if (gradient) {
      std::copy_n(found.gradient.data(), found.gradient.size(), gradient);
    }
    if (information) {
      std::copy_n(found.information.data(), found.information.size(), information);
    }
  });
}

tendonfmu_status tendonfmu_estimator_jacobian(tendonfmu_estimator* estimator, size_t recording, const double* z,
                                              size_t first, size_t blocks, size_t length, double* torque, double* jump,
                                              double* torque_derivative, double* jump_derivative) {
  if (!estimator || !z || length == 0) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_ARGUMENT, [&] {
    const fit_problem& problem = estimator->problem;
    const std::size_t n = problem.joints(), row = n * problem.unknowns.count();
    const double share = 1.0 / static_cast<double>(length);
    const std::size_t count = blocks > SIZE_MAX / length ? SIZE_MAX : blocks * length;
    free_finger finger(problem.image.data(), problem.image.size());
    sample_rows rows(problem.unknowns, finger.get(), derivatives::nearly);
    const auto at = [](double* to, std::size_t offset) { return to ? to + offset : nullptr; };
    replay(estimator, recording, checked(problem, z), first, count, &finger,
           [&](const recording_track&, std::size_t k) {
             const std::size_t block = (k - first) / length;
             const bool begins = (k - first) % length == 0;
             for (const auto& [to, width] :
                  {std::pair(torque, n), {jump, n}, {torque_derivative, row}, {jump_derivative, row}}) {
               if (to && begins) {
                 std::fill_n(to + block * width, width, 0.0);
               }
             }
             rows.read();
             rows.add_dense(at(torque_derivative, block * row), at(jump_derivative, block * row), share);
             for (std::size_t j = 0; j < n; ++j) {
               if (torque) {
                 torque[block * n + j] += share * rows.torque(j);
               }
               if (jump) {
                 jump[block * n + j] += share * rows.jump(j);
               }
             }
           });
  });
}

tendonfmu_status tendonfmu_estimator_innovations(tendonfmu_estimator* estimator, size_t recording, const double* z,
                                                 double* innovation, double* variance, double* bias) {
  if (!estimator || !z) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_ARGUMENT, [&] {
    const fit_problem& problem = estimator->problem;
    const std::vector<double> unknowns = checked(problem, z);
    const derived_numbers& derived = problem.finger.get()->derived;
    const std::size_t n = problem.joints(),
                      samples = recording < problem.recordings.size() ? problem.recordings[recording].samples() : 0;
    free_finger finger(problem.image.data(), problem.image.size());
    std::vector<bias_filter> filters(n);
    std::vector<double> gain, weight;
    if (samples > 0) {
      bias_gains gains(problem.recordings[recording], derived.settings, 1);
      gain = std::move(gains.gain);
      weight = std::move(gains.weight);
    }
    for (std::size_t j = 0; j < n && derived.settings.has_initial_torque; ++j) {
      const std::int32_t column = problem.unknowns.initial_torque(j);
      filters[j] = {column < 0 ? derived.initial_torque[j] : unknowns[static_cast<std::size_t>(column)], true};
    }
    const double nan = std::numeric_limits<double>::quiet_NaN();
    replay(estimator, recording, unknowns, 0, samples, &finger, [&](const recording_track& r, std::size_t k) {
      const finger_scratch& s = finger.get()->scratch;
      const bool starts = gain[k] == 1.0 && weight[k] == 0.0;
      for (std::size_t j = 0; j < n; ++j) {
        const double torque = finger.get()->remembered.torque[j] - r.external_torque(k, j) - s.friction[j];
        const double e = filters[j].take(torque, s.bias_step[j], starts ? 0.0 : gain[k], starts);
        put(innovation, k * n + j, filters[j].started && !starts ? e : nan);
        put(bias, k * n + j, filters[j].started ? filters[j].bias : nan);
      }
      put(variance, k, weight[k] > 0.0 ? 1.0 / (weight[k] * weight[k]) : nan);
    });
  });
}

tendonfmu_fit_options tendonfmu_default_fit_options(void) {
  const batch_options options;
  return {options.prior_std, options.tolerance, options.most_passes, options.stride, options.threads};
}

tendonfmu_status tendonfmu_estimator_fit(tendonfmu_estimator* estimator, const double* start,
                                         const tendonfmu_fit_options* options, tendonfmu_fit_watch watch, void* context,
                                         tendonfmu_fit_result* result) {
  if (!estimator || !options || !result || !result->z) {
    return fail(estimator, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return guarded(estimator, TENDONFMU_BAD_ARGUMENT, [&] {
    const fit_problem& problem = estimator->problem;
    std::vector<double> begin;
    for (std::size_t k = 0; k < problem.unknowns.count(); ++k) {
      begin.push_back(start ? start[k] : problem.unknowns[k].start);
      if (std::isnan(begin[k])) {
        throw refused("unknown " + std::to_string(k) + " (" + problem.unknowns[k].path +
                      ") = nan: expected a finite number");
      }
    }
    batch_watch look;
    if (watch) {
      look = [watch, context](const batch_progress& p) {
        const tendonfmu_fit_progress progress = {p.pass, p.stride, p.samples_done, p.samples, p.cost, p.best->data()};
        return watch(context, &progress) != 0;
      };
    }
    const batch_result found = fit_batch(
        problem, begin,
        {options->prior_std, options->tolerance, options->most_passes, options->stride, options->threads}, look);
    std::copy(found.z.begin(), found.z.end(), result->z);
    if (result->gradient && found.at.complete) {
      std::copy_n(found.at.gradient.data(), found.at.gradient.size(), result->gradient);
    }
    if (result->information && found.at.complete) {
      std::copy_n(found.at.information.data(), found.at.information.size(), result->information);
    }
    if (result->covariance && found.at.complete) {
      std::copy_n(found.covariance.data(), found.covariance.size(), result->covariance);
    }
    result->cost = found.cost;
    result->prior_cost = found.prior_cost;
    result->passes = found.passes;
    result->steps = found.steps;
    result->converged = found.converged;
    result->stopped = found.stopped;
  });
}

}  // extern "C"
