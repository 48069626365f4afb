#include "floating_point.h"

#include "extension_signals.h"

#include <string.h>

static effect_signals signal_direction(const tendonfmu_finger* f, signal_derivative* d) {
  return (effect_signals){.joints = f->joints,
                          .tendons = f->tendons,
                          .source = (int)f->remembered.scalar[STATE_SOURCE],
                          .force = d->force,
                          .position = d->position,
                          .angle = d->angle,
                          .velocity = d->velocity,
                          .inverse_stiffness = f->derived.inverse_stiffness};
}

void angles_along(const tendonfmu_finger* f, signal_derivative* d) {
  if ((int)f->remembered.scalar[STATE_SOURCE] != TENDONFMU_TENDON_POSITIONS) {
    return;
  }
  for (size_t j = 0; j < f->joints; ++j) {
    for (size_t i = 0; i < f->tendons; ++i) {
      const double stretch = d->force[i] * f->derived.inverse_stiffness[i];
      d->angle[j] += inverse_in_use(f)[j * f->tendon_lanes + i] * (d->position[i] - stretch);
    }
  }
}

void shape_signals(tendonfmu_finger* f, double time, int late) {
  const finger_scratch* s = &f->scratch;
  effect_signals signals = {.joints = f->joints,
                            .tendons = f->tendons,
                            .first = f->remembered.scalar[STATE_INITIALISED] == 0.0,
                            .source = (int)f->remembered.scalar[STATE_SOURCE],
                            .late = late,
                            .time = time,
                            .force = s->force,
                            .position = s->position,
                            .angle = s->angle,
                            .velocity = s->velocity + f->joints * f->tendon_lanes,
                            .inverse_stiffness = f->derived.inverse_stiffness};
  for (size_t n = 0; n < f->extensions.signals; ++n) {
    const extension_row* row = signal_row(f, n);
    row->effect->signal(row->place, row->parameters, &signals, row->memory, row->next);
  }
}

void pass_signals(const tendonfmu_finger* f, signal_derivative* d, int late) {
  effect_signals direction = signal_direction(f, d);
  direction.late = late;
  for (size_t r = 0; r < f->extensions.signals; ++r) {
    const extension_row* row = signal_row(f, r);
    row->effect->signal_pass(row->place, row->parameters, row->memory, &direction);
  }
}
