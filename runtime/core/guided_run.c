/* Runs in which the caller says what the bias learns from (docs/reference/semantics/bias.md#guided-runs). */
#include "floating_point.h"

#include "finger_memory.h"

#include <math.h>

#include "message.h"
#include "step.h"

static tendonfmu_status refuse(tendonfmu_finger* finger, const char* reason) {
  message_write((message_line){finger->error, ERROR_BYTES}, "%s", reason);
  return TENDONFMU_BAD_ARGUMENT;
}

/* of a row, after that of the row before; the bias begins with the first sample that it may learn from */
static sample_guide guide_of_row(const tendonfmu_finger* finger, const tendonfmu_guide* guide, size_t row) {
  const sample_guide before = finger->guide;
  const int waits = before.begins && !before.learns && !finger->derived.settings.has_initial_torque;
  return (sample_guide){.guides = 1,
                        .begins = row == 0 || waits,
                        .learns = !guide->learns || guide->learns[row],
                        .known_torque = guide->known_torque ? guide->known_torque + row * finger->joints : NULL};
}

static void give_variance(const tendonfmu_finger* finger, double* variance, size_t row) {
  for (size_t j = 0; variance && j < finger->joints; ++j) {
    variance[row * finger->joints + j] = finger->guide.begins ? NAN : finger->scratch.residual_variance[j];
  }
}

tendonfmu_status tendonfmu_run_guided(tendonfmu_finger* finger, size_t samples, const double* time,
                                      const tendonfmu_inputs* inputs, const tendonfmu_guide* guide,
                                      const tendonfmu_outputs* outputs, size_t* done) {
  tendonfmu_status status = TENDONFMU_OK;
  size_t row = 0;
  if (done) {
    *done = 0;
  }
  if (!finger) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  if (!inputs || !guide || !outputs || (!time && samples)) {
    return refuse(finger, "an argument is missing: NULL");
  }
  if (finger->derived.settings.watches_sensors) {
    return refuse(finger, "a guided run with sensor_fault: expected a finger without");
  }
  for (; row < samples; ++row) {
    const tendonfmu_inputs sample = samples_row(finger, inputs, row);
    finger->guide = guide_of_row(finger, guide, row);
    status = row ? tendonfmu_step(finger, time[row], &sample) : tendonfmu_initialise(finger, time[row], &sample);
    if (status != TENDONFMU_OK) {
      break;
    }
    samples_give_outputs(finger, outputs, row);
    give_variance(finger, guide->variance, row);
  }
  finger->guide = (sample_guide){0};
  if (done) {
    *done = row;
  }
  return status;
}
