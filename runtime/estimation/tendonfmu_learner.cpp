/* The C interface of the learner, tendonfmu_learner.h. */
#include <algorithm>
#include <cmath>
#include <limits>

#include "c_interface.h"
#include "learner.h"

using namespace tendonfmu::estimation;

struct tendonfmu_learner {
  tendonfmu_learner(const void* image, std::size_t size, const std::int32_t* group, const double* scale,
                    const learner_options& options)
      : learner(image, size, group, scale, options) {}
  finger_learner learner;
  mutable std::string error;
};

namespace {

constexpr std::size_t rows_between_looks = 1000;

bool is_source(int kinematics_source) {
  return kinematics_source >= TENDONFMU_TENDON_POSITIONS && kinematics_source <= TENDONFMU_JOINT_VELOCITIES;
}

/* Arrays of a recording, and where its innovations go. */
struct learner_run {
  finger_learner& learner;
  std::size_t samples;
  const double* time;
  const tendonfmu_inputs& inputs;
  int kinematics_source;
  const double* external_torque;
  const unsigned char* use;
  double *innovation, *variance;

  learner_sample sample(std::size_t row) const {
    const std::size_t n = learner.finger()->joints, m = learner.finger()->tendons;
    const auto at = [row](const double* values, std::size_t width) { return values ? values + row * width : nullptr; };
    return {time[row],
            {at(inputs.tendon_force, m), at(inputs.tendon_position, m), at(inputs.joint_position, n),
             at(inputs.joint_velocity, n)},
            at(external_torque, n),
            !use || use[row] != 0};
  }

  /* the row after `row` is the first that has not been taken */
  void take(std::size_t row) {
    try {
      if (row == 0) {
        learner.initialise(sample(0), kinematics_source);
      } else if (time[row] == time[row - 1]) {
        throw refused("time: expected later than the row before");
      } else if (learner.step(sample(row))) {
        copy_innovations(row + 1);
      }
    } catch (const refused& reason) {
      throw refused("row " + std::to_string(row + 1) + ": " + reason.what());
    }
  }

  /* of the block that ends before row `end` */
  void copy_innovations(std::size_t end) const {
    const kalman_filter& filter = learner.filter();
    const std::size_t n = learner.finger()->joints, first = (end - filter.updated()) * n;
    if (innovation) {
      std::copy_n(filter.innovation(), filter.updated() * n, innovation + first);
    }
    if (variance) {
      std::copy_n(filter.innovation_variance(), filter.updated() * n, variance + first);
    }
  }

  void finish(std::size_t end) {
    if (learner.filter().gathered() > 0) {
      learner.finish();
      copy_innovations(end);
    }
  }
};

}  // namespace

extern "C" {

tendonfmu_learner_options tendonfmu_default_learner_options(void) {
  const learner_options options;
  return {options.prior_std, options.block, options.parameter_drift};
}

tendonfmu_learner* tendonfmu_learner_create(const void* image, size_t image_size, const int32_t* group,
                                            const double* scale, const tendonfmu_learner_options* options,
                                            char* message, size_t message_size) {
  return created(image, message, message_size, [&] {
    learner_options wanted;
    if (options) {
      wanted = {options->prior_std, options->block, options->parameter_drift};
    }
    return new tendonfmu_learner(image, image_size, group, scale, wanted);
  });
}

void tendonfmu_learner_destroy(tendonfmu_learner* learner) {
  delete learner;
}

const char* tendonfmu_learner_last_error(const tendonfmu_learner* learner) {
  return learner ? learner->error.c_str() : "no learner: NULL";
}

size_t tendonfmu_learner_joint_count(const tendonfmu_learner* learner) {
  return learner ? learner->learner.finger()->joints : 0;
}
size_t tendonfmu_learner_tendon_count(const tendonfmu_learner* learner) {
  return learner ? learner->learner.finger()->tendons : 0;
}
size_t tendonfmu_learner_parameter_count(const tendonfmu_learner* learner) {
  return learner ? learner->learner.finger()->shape.parameter_count : 0;
}
size_t tendonfmu_learner_unknown_count(const tendonfmu_learner* learner) {
  return learner ? learner->learner.unknowns().count() : 0;
}

tendonfmu_status tendonfmu_learner_get_unknown(const tendonfmu_learner* learner, size_t index,
                                               tendonfmu_unknown* unknown) {
  if (!learner || !unknown) {
    return fail(learner, TENDONFMU_BAD_ARGUMENT, missing);
  }
  return describe_unknown(learner, learner->learner.unknowns(), index, unknown);
}

tendonfmu_status tendonfmu_learner_initialise(tendonfmu_learner* learner, double time, const tendonfmu_inputs* inputs,
                                              int kinematics_source, const double* external_torque, int use) {
  if (!learner || !inputs || !is_source(kinematics_source)) {
    return fail(learner, TENDONFMU_BAD_ARGUMENT, inputs ? "kinematics_source: expected 1, 2 or 3" : missing);
  }
  return guarded(learner, TENDONFMU_BAD_SAMPLE, TENDONFMU_BAD_ARGUMENT, [&] {
    learner->learner.initialise({time, *inputs, external_torque, use != 0}, kinematics_source);
  });
}

tendonfmu_status tendonfmu_learner_step(tendonfmu_learner* learner, double time, const tendonfmu_inputs* inputs,
                                        const double* external_torque, int use) {
  if (!learner || !inputs) {
    return fail(learner, TENDONFMU_BAD_ARGUMENT, missing);
  }
  if (!learner->learner.initialised()) {
    return fail(learner, TENDONFMU_WRONG_ORDER, "a step before the first sample: expected initialise first");
  }
  return guarded(learner, TENDONFMU_BAD_SAMPLE, TENDONFMU_BAD_ARGUMENT, [&] {
    learner->learner.step({time, *inputs, external_torque, use != 0});
  });
}

tendonfmu_status tendonfmu_learner_finish(tendonfmu_learner* learner) {
  if (!learner) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  return guarded(learner, TENDONFMU_BAD_SAMPLE, TENDONFMU_BAD_ARGUMENT, [&] { learner->learner.finish(); });
}

tendonfmu_status tendonfmu_learner_begin_pass(tendonfmu_learner* learner) {
  if (!learner) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  return guarded(learner, TENDONFMU_BAD_SAMPLE, TENDONFMU_BAD_ARGUMENT, [&] { learner->learner.begin_pass(); });
}

tendonfmu_status tendonfmu_learner_run(tendonfmu_learner* learner, size_t samples, const double* time,
                                       const tendonfmu_inputs* inputs, int kinematics_source,
                                       const double* external_torque, const unsigned char* use, double* innovation,
                                       double* variance, tendonfmu_learner_watch watch, void* context, size_t* done) {
  std::size_t row = 0;
  tendonfmu_status status = TENDONFMU_OK;
  if (!learner || !time || !inputs || !is_source(kinematics_source)) {
    status = fail(learner, TENDONFMU_BAD_ARGUMENT, time && inputs ? "kinematics_source: expected 1, 2 or 3" : missing);
  } else {
    learner_run run{learner->learner, samples, time,       *inputs, kinematics_source,
                    external_torque,  use,     innovation, variance};
    for (double* rows : {innovation, variance}) {
      std::fill_n(rows, rows ? samples * learner->learner.finger()->joints : 0,
                  std::numeric_limits<double>::quiet_NaN());
    }
    status = guarded(learner, TENDONFMU_BAD_SAMPLE, TENDONFMU_BAD_ARGUMENT, [&] {
      if (samples < 2) {
        throw refused("samples = " + std::to_string(samples) + ": expected at least 2");
      }
      for (bool wanted = true; row < samples && wanted; ++row) {
        run.take(row);
        wanted = !watch || row % rows_between_looks != 0 || watch(context, row, samples) != 0;
      }
      run.finish(row);
    });
  }
  if (done) {
    *done = row;
  }
  return status;
}

tendonfmu_status tendonfmu_learner_get_values(const tendonfmu_learner* learner, double* values,
                                              double* standard_errors) {
  if (!learner) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  if (values) {
    learner->learner.values(values);
  }
  if (standard_errors) {
    learner->learner.standard_errors(standard_errors);
  }
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_learner_get_unknowns(const tendonfmu_learner* learner, double* z, double* covariance) {
  if (!learner) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  if (z) {
    std::copy_n(learner->learner.filter().z(), learner->learner.unknowns().count(), z);
  }
  if (covariance) {
    learner->learner.filter().covariance(covariance);
  }
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_learner_get_bias(const tendonfmu_learner* learner, double* bias, double* standard_errors) {
  if (!learner) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  if (!learner->learner.initialised() || !learner->learner.bias_started()) {
    return fail(learner, TENDONFMU_WRONG_ORDER, "no bias before the first sample that is used");
  }
  const kalman_filter& filter = learner->learner.filter();
  for (std::size_t j = 0; j < learner->learner.finger()->joints; ++j) {
    if (bias) {
      bias[j] = filter.bias()[j];
    }
    if (standard_errors) {
      standard_errors[j] = std::sqrt(filter.bias_variance(j));
    }
  }
  return TENDONFMU_OK;
}

tendonfmu_status tendonfmu_learner_get_innovations(const tendonfmu_learner* learner, size_t* samples,
                                                   double* innovation, double* variance) {
  if (!learner) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  const kalman_filter& filter = learner->learner.filter();
  const std::size_t count = filter.updated() * learner->learner.finger()->joints;
  if (samples) {
    *samples = filter.updated();
  }
  if (innovation) {
    std::copy_n(filter.innovation(), count, innovation);
  }
  if (variance) {
    std::copy_n(filter.innovation_variance(), count, variance);
  }
  return TENDONFMU_OK;
}

size_t tendonfmu_learner_slack_samples(const tendonfmu_learner* learner) {
  return learner ? learner->learner.slack_samples() : 0;
}

}  // extern "C"
