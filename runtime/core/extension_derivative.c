#include "floating_point.h"

#include "extension_derivative.h"

#include "directional_derivative.h"
#include "extensions.h"

static void add_plain(parameter_derivative* d, uint32_t parameter, const double* torque, const double* jump) {
  for (size_t j = 0; j < d->joints; ++j) {
    if (torque[j] != 0.0 || jump[j] != 0.0) {
      d->plain[d->plain_count++] =
          (plain_term){.parameter = parameter, .joint = (uint32_t)j, .slope = torque[j], .jump = jump[j]};
    }
  }
}

static void read_torque_row(const tendonfmu_finger* f, const extension_row* row, parameter_derivative* d) {
  const effect_sample sample = remembered_sample(f);
  for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
    double unit[EFFECT_MAX_PARAMETERS] = {0.0}, torque[MODEL_MAX_JOINTS] = {0.0};
    const double none[MODEL_MAX_JOINTS] = {0.0};
    unit[k] = 1.0;
    row->effect->torque(row->place, unit, &sample, row->memory, torque);
    add_plain(d, row->first_parameter + k, torque, none);
  }
}

static void read_signal_row(const tendonfmu_finger* f, size_t n, parameter_derivative* d) {
  const extension_row* row = signal_row(f, n);
  for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
    double torque[MODEL_MAX_JOINTS], jump[MODEL_MAX_JOINTS];
    const double* angle = signal_slopes(f, row, k);
    signal_derivative signals;
    derive_signals(f, n, k, 0, &signals);
    const double* memory = angle + 2 * f->joints + f->tendons;
    const state_direction direction = {angle, angle + f->joints, signals.force, memory};
    torque_along(f, &direction, torque, jump);
    add_plain(d, row->first_parameter + k, torque, jump);
  }
}

/* what the other friction rows make of a slot */
static double other_grips(const tendonfmu_finger* f, const extension_row* row, size_t slot, double own) {
  if (own != 0.0) {
    return f->scratch.grip[slot] / own;
  }
  double product = 1.0;
  for (size_t r = 0; r < f->extensions.friction; ++r) {
    const extension_row* other = friction_row(f, r);
    const size_t members = other == row ? 0 : friction_members(f, other->place);
    for (size_t k = 0; k < members; ++k) {
      if (friction_slot(f, other->place, k) == slot) {
        product *=
            other->effect->grip(other->place, other->parameters, other->memory, friction_member(other->place, k)).value;
      }
    }
  }
  return product;
}

/* the two places whose friction slides with a slot; the second of a tendon is the pulley at the joint before */
static void places_of_slot(const tendonfmu_finger* f, size_t slot, size_t place[2], size_t* count) {
  const size_t n = f->joints, lanes = f->tendon_lanes;
  if (slot >= n * lanes) {
    place[0] = f->tendons * 2 * n + 2 * (slot - n * lanes);
    place[1] = place[0] + 1;
    *count = 2;
  } else {
    place[0] = 2 * (slot % lanes * n + slot / lanes);
    place[1] = place[0] - 1;
    *count = slot >= lanes ? 2 : 1;
  }
}

/* −κ·e of a place at joint j of tendon or joint; entry_load */
static double kept_torque(const tendonfmu_finger* f, const parameter_derivative* d, size_t place, size_t j) {
  const size_t n = f->joints, i = place / (2 * n), own = place % (2 * n) / 2;
  if (place >= 2 * n * f->tendons) {
    return j == (place - 2 * n * f->tendons) / 2 ? d->kept_entry[place] : 0.0;
  }
  return j >= own ? f->derived.moment_arm[j * f->tendon_lanes + i] * d->kept_entry[place] : 0.0;
}

/* Slopes of T_j and Δb_j by every number of a row. */
typedef struct row_slopes {
  double torque[EFFECT_MAX_PARAMETERS][MODEL_MAX_JOINTS], jump[EFFECT_MAX_PARAMETERS][MODEL_MAX_JOINTS];
} row_slopes;

/* what a row with this grip makes of one place; others: what the other rows make of it */
static void add_place(const tendonfmu_finger* f, const parameter_derivative* d, const extension_row* row, size_t place,
                      double others, const effect_grip* grip, row_slopes* sum) {
  const double moved = others * d->base[place], jumped = grip->slides ? 0.0 : others * d->jump_base[place];
  const double kept = d->kept_entry[place] != 0.0 && grip->value != 0.0 ? 1.0 / grip->value : 0.0;
  if (moved == 0.0 && jumped == 0.0 && kept == 0.0) {
    return;
  }
  for (size_t at = place * d->joints, j = 0; j < d->joints; ++at, ++j) {
    const double torque = moved != 0.0 || jumped != 0.0 ? d->torque_factor[at] * moved : 0.0;
    double jump =
        d->has_jump && (moved != 0.0 || jumped != 0.0) ? d->jump_factor[at] * moved + d->bias_factor[at] * jumped : 0.0;
    if (kept != 0.0) {
      jump += kept * kept_torque(f, d, place, j);
    }
    for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
      sum->torque[k][j] += torque * grip->by_parameter[k];
      sum->jump[k][j] += jump * grip->by_parameter[k];
    }
  }
}

static void read_friction_row(const tendonfmu_finger* f, const extension_row* row, parameter_derivative* d) {
  row_slopes sum = {{{0.0}}, {{0.0}}};
  const size_t members = friction_members(f, row->place);
  for (size_t member = 0; member < members; ++member) {
    const size_t slot = friction_slot(f, row->place, member);
    const effect_grip grip =
        row->effect->grip(row->place, row->parameters, row->memory, friction_member(row->place, member));
    const double others = other_grips(f, row, slot, grip.value);
    size_t place[2], count;
    places_of_slot(f, slot, place, &count);
    for (size_t p = 0; p < count; ++p) {
      add_place(f, d, row, place[p], others, &grip, &sum);
    }
  }
  for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
    add_plain(d, row->first_parameter + k, sum.torque[k], sum.jump[k]);
  }
}

void extension_derivative_read(const tendonfmu_finger* f, parameter_derivative* d) {
  for (size_t n = 0; n < f->extensions.signals; ++n) {
    read_signal_row(f, n, d);
  }
  for (size_t n = 0; n < f->extensions.friction; ++n) {
    read_friction_row(f, friction_row(f, n), d);
  }
  for (size_t n = 0; n < f->extensions.torques; ++n) {
    read_torque_row(f, torque_row(f, n), d);
  }
}
