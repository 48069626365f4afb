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
                          .position_behind = d->position_behind,
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

static size_t slope_count(const tendonfmu_finger* f) {
  const size_t joint_rows = f->derived.settings.filters_position ? 5 : 2;
  return joint_rows * f->joints + f->tendons + f->shape.effect_memory;
}

/* ∂x, ∂a and ∂z of the position filter, rows of joints, among the slopes by a number of a signal row */
static size_t filter_slopes(const tendonfmu_finger* f) {
  return 2 * f->joints + f->tendons + f->shape.effect_memory;
}

const double* signal_slopes(const tendonfmu_finger* f, const extension_row* row, uint32_t k) {
  return row->slopes + slope_count(f) * k;
}

static const double* memory_of(const extension_row* row, int in_step) {
  return in_step ? row->next : row->memory;
}

void derive_signals(const tendonfmu_finger* f, size_t n, uint32_t k, int in_step, signal_derivative* d) {
  const double* before = signal_slopes(f, signal_row(f, n), k);
  memset(d, 0, sizeof *d);
  effect_signals direction = signal_direction(f, d);
  if (in_step) {
    direction.angle_before = before;
    direction.position_before = before + 2 * f->joints;
  }
  for (direction.late = 0; direction.late < 2; ++direction.late) {
    for (size_t r = direction.late ? 0 : n; r < f->extensions.signals; ++r) {
      const extension_row* row = signal_row(f, r);
      if (r == n) {
        row->effect->signal_slope(row->place, row->parameters, k, memory_of(row, in_step), &direction);
      } else {
        row->effect->signal_pass(row->place, row->parameters, memory_of(row, in_step), &direction);
      }
    }
    if (!direction.late) {
      angles_along(f, d);
    }
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

/* ∂x, ∂v, ∂a and ∂z of the position filter by ∂q of this sample: next, from before; v stands behind the angles */
static void follow_filter(const tendonfmu_finger* f, double step, int first, const double* before, double* next) {
  const size_t n = f->joints, at = filter_slopes(f);
  const double* gain[3];
  for (int k = 0; k < 3; ++k) {
    gain[k] = filter_memory(f, f->scratch.filter, (filter_row_kind)(FILTER_GAIN_0 + k));
  }
  const double* carries = filter_memory(f, f->scratch.filter, FILTER_CARRIES);
  for (size_t j = 0; j < n; ++j) {
    const double *x = before + at + j, *v = before + n + j, *a = x + n, *z = a + n;
    double *to = next + at + j, *speed = next + n + j;
    if (first || step > LONGEST_FILTER_STEP) {
      to[0] = to[2 * n] = next[j];
      to[n] = speed[0] = 0.0;
      continue;
    }
    const double ahead = *x + step * (*v + 0.5 * step * *a), innovation = next[j] - ahead;
    to[0] = ahead + gain[0][j] * innovation;
    speed[0] = *v + step * *a + gain[1][j] * innovation;
    to[n] = *a + gain[2][j] * innovation;
    to[2 * n] = carries[j] != 0.0 ? to[0] : *z;
  }
}

void follow_signals(tendonfmu_finger* f, double step, double velocity_gain) {
  const size_t n = f->joints;
  const int first = f->remembered.scalar[STATE_INITIALISED] == 0.0;
  const int given = (int)f->remembered.scalar[STATE_SOURCE] == TENDONFMU_JOINT_VELOCITIES;
  const double share = velocity_gain * step;
  signal_derivative d;
  for (size_t r = 0; r < f->extensions.signals; ++r) {
    const extension_row* row = signal_row(f, r);
    for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
      const double* before = signal_slopes(f, row, k);
      double* next = row->next_slopes + slope_count(f) * k;
      derive_signals(f, r, k, 1, &d);
      for (size_t j = 0; j < n; ++j) {
        const double filtered = before[n + j] + velocity_gain * (d.angle[j] - before[j]) - share * before[n + j];
        next[j] = d.angle[j];
        next[n + j] = given ? d.velocity[j] : first ? 0.0 : filtered;
      }
      if (filters_position(f)) {
        follow_filter(f, step, first, before, next);
      } else if (f->derived.settings.filters_position) {
        memset(next + filter_slopes(f), 0, 3 * n * sizeof(double)); /* velocities are given */
      }
      memcpy(next + 2 * n, d.position_behind, f->tendons * sizeof(double));
    }
  }
}

/* --- what the others remember ---------------------------------------------------------------------------------------
 */

/* what number k of a signal row makes of what the others remember */
static void follow_memory(const tendonfmu_finger* f, const extension_row* signal, uint32_t k) {
  const size_t n = f->joints, others = 2 * n + f->tendons;
  const double *slopes_before = signal_slopes(f, signal, k), *before = slopes_before + others;
  double *angle = signal->next_slopes + slope_count(f) * k, *after = angle + others;
  const effect_direction direction = {.angle = angle, .velocity = angle + n};
  for (size_t r = f->extensions.signals; r < f->shape.extension_count - f->extensions.memory; ++r) {
    const extension_row* row = f->extensions.row + r;
    if (row->effect->advance_slope) {
      row->effect->advance_slope(row->place, row->parameters, &f->scratch.sample, row->memory, &direction,
                                 before + row->offset, after + row->offset);
    }
  }
}

void follow_memories(tendonfmu_finger* f) {
  for (size_t r = 0; r < f->extensions.signals; ++r) {
    const extension_row* row = signal_row(f, r);
    for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
      follow_memory(f, row, k);
    }
  }
}
