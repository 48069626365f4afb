#include "floating_point.h"

#include "extension_derivative.h"

#include <string.h>

#include "directional_derivative.h"
#include "extension_signals.h"

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
    if (row->effect->by_parameter) {
      row->effect->by_parameter(row->place, row->parameters, k, &sample, row->memory, torque);
    } else {
      unit[k] = 1.0;
      row->effect->torque(row->place, unit, &sample, row->memory, torque);
    }
    add_plain(d, row->first_parameter + k, torque, none);
  }
}

static void along_signal(const tendonfmu_finger* f, size_t n, uint32_t k, double* torque, double* jump, double* entry) {
  const double* angle = signal_slopes(f, signal_row(f, n), k);
  const double* memory = angle + 2 * f->joints + f->tendons;
  signal_derivative signals;
  derive_signals(f, n, k, 0, &signals);
  const state_direction direction = {angle, angle + f->joints, signals.force, memory};
  torque_along(f, &direction, torque, jump, entry);
}

static void read_signal_row(const tendonfmu_finger* f, size_t n, parameter_derivative* d) {
  const extension_row* row = signal_row(f, n);
  for (uint32_t k = 0; k < row->effect->parameter_count; ++k) {
    double torque[MODEL_MAX_JOINTS], jump[MODEL_MAX_JOINTS];
    along_signal(f, n, k, torque, jump, NULL);
    add_plain(d, row->first_parameter + k, torque, jump);
  }
}

void extension_entry_slopes(const tendonfmu_finger* f, size_t row_number, uint32_t k, double* entry) {
  double torque[MODEL_MAX_JOINTS], jump[MODEL_MAX_JOINTS];
  along_signal(f, row_number, k, torque, jump, entry);
}

/* what the other friction rows make of a slot */
static double other_grips(const tendonfmu_finger* f, const extension_row* row, size_t slot, double own) {
  if (own != 0.0) {
    return f->scratch.grip[slot] / own;
  }
  double product = 1.0;
  for (size_t r = 0; r < f->extensions.friction; ++r) {
    const extension_row* other = friction_row(f, r);
    size_t member;
    if (other != row && friction_acts_on(f, other, slot, &member)) {
      product *= other->effect->grip(other->place, other->parameters, other->memory, member).value;
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

/* Slopes of T_j and Δb_j by every number of a row. */
typedef struct row_slopes {
  double torque[EFFECT_MAX_PARAMETERS][MODEL_MAX_JOINTS], jump[EFFECT_MAX_PARAMETERS][MODEL_MAX_JOINTS];
} row_slopes;

static void add_place(const parameter_derivative* d, const place_slopes* slopes, size_t place, uint32_t parameters,
                      row_slopes* sum) {
  for (size_t at = place * d->joints, j = 0; j < d->joints; ++at, ++j) {
    for (uint32_t k = 0; k < parameters; ++k) {
      sum->torque[k][j] += d->torque_factor[at] * slopes->friction[k];
      if (d->has_jump) {
        sum->jump[k][j] += d->jump_factor[at] * slopes->friction[k] + d->bias_factor[at] * slopes->jump[k];
      }
    }
  }
}

/* F and b of a place by the numbers of a row that acts on it with this grip; 0: neither depends on them */
static int slopes_of_place(const parameter_derivative* d, size_t place, double others, const effect_grip* grip,
                           place_slopes* slopes) {
  const double moved = others * d->base[place], jumped = others * d->jump_base[place];
  for (int k = 0; k < EFFECT_MAX_PARAMETERS; ++k) {
    slopes->friction[k] = moved * grip->by_parameter[k];
    slopes->jump[k] = jumped * grip->by_parameter[k];
  }
  return moved != 0.0 || jumped != 0.0;
}

void extension_place_slopes(const tendonfmu_finger* f, const parameter_derivative* d, size_t row_number, size_t place,
                            place_slopes* slopes) {
  const extension_row* row = friction_row(f, row_number);
  const size_t members = friction_members(f, row->place);
  memset(slopes, 0, sizeof *slopes);
  for (size_t member = 0; member < members; ++member) {
    const size_t slot = friction_slot(f, row->place, member);
    size_t places[2], count;
    places_of_slot(f, slot, places, &count);
    if (places[0] == place || (count == 2 && places[1] == place)) {
      const effect_grip grip = row->effect->grip(row->place, row->parameters, row->memory, member);
      slopes_of_place(d, place, other_grips(f, row, slot, grip.value), &grip, slopes);
    }
  }
}

static void read_friction_row(const tendonfmu_finger* f, const extension_row* row, parameter_derivative* d) {
  row_slopes sum = {{{0.0}}, {{0.0}}};
  const size_t members = friction_members(f, row->place);
  for (size_t member = 0; member < members; ++member) {
    const size_t slot = friction_slot(f, row->place, member);
    const effect_grip grip = row->effect->grip(row->place, row->parameters, row->memory, member);
    const double others = other_grips(f, row, slot, grip.value);
    size_t place[2], count;
    places_of_slot(f, slot, place, &count);
    for (size_t p = 0; p < count; ++p) {
      place_slopes slopes;
      if (slopes_of_place(d, place[p], others, &grip, &slopes)) {
        add_place(d, &slopes, place[p], row->effect->parameter_count, &sum);
      }
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
