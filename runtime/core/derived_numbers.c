#include "floating_point.h"

#include "finger_memory.h"

#include <math.h>
#include <string.h>

#include "extensions.h"
#include "pseudo_inverse.h"
#include "sensor_fault.h"

static const double two_pi = 6.28318530717958647692;

typedef struct derivation {
  tendonfmu_finger* finger;
  const double* values;
  uint32_t next_record; /* of edges */
  uint32_t points;      /* working points of the edge being read */
} derivation;

/* 1/x of x > 0, bounded, so that 0·(1/x) is 0 for the smallest x that a double can hold */
static double bounded_inverse(double x) {
  return 1.0 / x < 1e300 ? 1.0 / x : 1e300;
}

/* numbers of a law in the description to the packed law; both sides of a symmetric law are equal */
static void pack_law(double* law, const double* numbers, law_kind kind) {
  const double* negative = numbers + (kind == LAW_ASYMMETRIC ? 4 : 0);
  law_pack_side(law, numbers[0], numbers[1], numbers[2], numbers[3]);
  law_pack_side(law + LAW_SIDE_NUMBERS, negative[0], negative[1], negative[2], negative[3]);
}

/* --- edges: K working points become K + 1 segments, of which the first and the last are constant -------------------
 */

static void begin_grid(derivation* d, const model_item* item) {
  const derived_numbers* to = &d->finger->derived;
  const size_t lanes = d->finger->tendon_lanes;
  const double* angles = d->values + item->first;
  double* column = to->edge_angle + to->edge_angle_row[item->joint] + item->tendon;
  double* segment = to->edge_segment + (size_t)d->next_record * 2;
  d->points = item->count;
  for (uint32_t k = 0; k < item->count; ++k) {
    column[k * lanes] = angles[k];
    segment[2 * (k + 1)] = angles[k];
    segment[2 * (k + 1) + 1] = k + 1 < item->count ? bounded_inverse(angles[k + 1] - angles[k]) : 0.0;
  }
}

static void pack_edge(derivation* d, const model_item* item) {
  const derived_numbers* to = &d->finger->derived;
  double* first = to->edge_law + (size_t)d->next_record * LAW_NUMBERS;
  double* law = first + (size_t)(item->point + 1) * LAW_NUMBERS;
  const uint32_t points = item->has_angles ? d->points : 1;
  pack_law(law, d->values + item->first, item->law);
  if (item->point == 0) {
    memcpy(first, law, LAW_NUMBERS * sizeof(double));
    to->edge_record[item->joint * d->finger->tendon_lanes + item->tendon] = d->next_record;
  }
  if (item->point + 1 == points) {
    memcpy(law + LAW_NUMBERS, law, LAW_NUMBERS * sizeof(double));
    d->next_record += points + 2;
  }
}

/* --- everything else ------------------------------------------------------------------------------------------------
 */

#define SETTING(name) \
  { .setting = offsetof(tendonfmu_finger, derived.settings.name) }
#define ROW(name) \
  { .row = offsetof(tendonfmu_finger, derived.name) }

/* what is a copy: to a number of the finger, or to a row of joints */
static const struct {
  uint16_t setting, row; /* one of them 0 */
} copies[ITEM_EXTENSION + 1] = {
    [ITEM_TENDON_THRESHOLD] = SETTING(tendon_threshold),
    [ITEM_JOINT_THRESHOLD] = SETTING(joint_threshold),
    [ITEM_FILTER_CUTOFF] = SETTING(cutoff_rate),
    [ITEM_DRIFT_VARIANCE] = SETTING(drift_variance),
    [ITEM_NOISE_STD] = SETTING(noise_std),
    [ITEM_NOISE_STD_PER_FORCE] = SETTING(noise_std_per_force),
    [ITEM_INITIAL_VARIANCE] = SETTING(initial_variance),
    [ITEM_FORGET_RATE] = SETTING(forget_rate),
    [ITEM_NOISE_TIME] = SETTING(noise_time),
    [ITEM_FAULT_HOLD_TIME] = SETTING(fault_hold_time),
    [ITEM_FAULT_FORCE_RESOLUTION] = SETTING(force_resolution),
    [ITEM_FAULT_POSITION_RESOLUTION] = SETTING(position_resolution),
    [ITEM_FAULT_JUMP_MARGIN] = SETTING(jump_margin),
    [ITEM_FAULT_SPRING_MARGIN] = SETTING(spring_margin),
    [ITEM_FAULT_LONGEST_STAND] = SETTING(longest_stand),
    [ITEM_FAULT_RECOVERY_TIME] = SETTING(recovery_time),
    [ITEM_INITIAL_TORQUE] = ROW(initial_torque),
    [ITEM_CONTACT_THRESHOLD] = ROW(contact_threshold),
    [ITEM_CONTACT_PER_FORCE] = ROW(contact_per_force),
    [ITEM_DEVIATION] = ROW(deviation),
    [ITEM_DEVIATION_PER_FORCE] = ROW(deviation_per_force),
    [ITEM_TIP] = ROW(links.tip),
};

static void derive_copy(const derivation* d, const model_item* item) {
  char* finger = (char*)d->finger;
  const size_t row = copies[item->kind].row, setting = copies[item->kind].setting;
  if (row) {
    memcpy(*(double**)(void*)(finger + row), d->values + item->first, item->count * sizeof(double));
  } else if (setting) {
    memcpy(finger + setting, d->values + item->first, sizeof(double));
  } /* extensions read their numbers where they are */
}

static void derive_band(const derivation* d, const model_item* item) {
  const size_t number = item->kind - ITEM_BAND_NOISE;
  for (size_t j = 0; j < item->count; ++j) {
    const double value = d->values[item->first + j];
    d->finger->derived.band_square[(j * BAND_NUMBERS + number) * BANDS + item->point] = value * value;
  }
}

static int derive_item(void* context, const model_item* item) {
  derivation* d = context;
  const derived_numbers* to = &d->finger->derived;
  const size_t lanes = d->finger->tendon_lanes, i = item->tendon, j = item->joint;
  const double* values = d->values + item->first;
  switch (item->kind) {
    case ITEM_COVER:
      to->cover_stiffness[j] = values[0];
      to->cover_rest[j] = values[1];
      break;
    case ITEM_JOINT_FRICTION: pack_law(to->joint_law + j * LAW_NUMBERS, values, item->law); break;
    case ITEM_LOAD_FRICTION: pack_law(to->load_law + j * LAW_NUMBERS, values, item->law); break;
    case ITEM_STIFFNESS:
      to->bidirectional[i] = item->bidirectional;
      to->stiffness[i] = values[0];
      to->inverse_stiffness[i] = bounded_inverse(values[0]);
      break;
    case ITEM_MOMENT_ARMS:
      for (uint32_t k = 0; k < item->count; ++k) {
        to->moment_arm[k * lanes + i] = values[k];
      }
      break;
    case ITEM_TENDON_ZERO: to->tendon_zero[i] = values[0]; break;
    case ITEM_PULLEY_FRICTION: pack_law(to->pulley_law + ((j + 1) * lanes + i) * LAW_NUMBERS, values, item->law); break;
    case ITEM_EDGE_ANGLES: begin_grid(d, item); break;
    case ITEM_EDGE_FRICTION: pack_edge(d, item); break;
    case ITEM_LINK_AXIS:
      memcpy(to->links.axis + 3 * j, values, 3 * sizeof *values);
      make_unit(to->links.axis + 3 * j);
      break;
    case ITEM_LINK_OFFSET: memcpy(to->links.offset + 3 * j, values, 3 * sizeof *values); break;
    default:
      if (item->kind >= ITEM_BAND_NOISE && item->kind <= ITEM_BAND_FRICTION_RESERVE) {
        derive_band(d, item);
      } else {
        derive_copy(d, item);
      }
  }
  return 0;
}

/* angles that no edge has lie at infinity, where no joint angle reaches them */
static void clear_grids(tendonfmu_finger* f) {
  size_t row = 0;
  for (size_t j = 0; j < f->joints; ++j) {
    f->derived.edge_angle_row[j] = row;
    for (size_t i = 0; i < f->shape.most_points[j] * f->tendon_lanes; ++i) {
      f->derived.edge_angle[row++] = INFINITY;
    }
  }
}

/* F_B of a slot acts at its joint and all behind, F_A one joint before, too */
static void find_what_can_hold(tendonfmu_finger* f) {
  const size_t lanes = f->tendon_lanes, slots = f->joints * lanes;
  memset(f->derived.can_hold, 0, slots / 4);
  for (size_t slot = 0; slot < slots; ++slot) {
    for (size_t at = slot < lanes ? slot : slot - lanes; at < slots; at += lanes) {
      f->derived.can_hold[slot / 4] |= f->derived.moment_arm[at] != 0.0;
    }
  }
}

static void derive_routing(tendonfmu_finger* f) {
  double matrix[MODEL_MAX_TENDONS * MODEL_MAX_JOINTS]; /* R, then R⁺ */
  const size_t n = f->joints, m = f->tendons, lanes = f->tendon_lanes;
  for (size_t i = 0; i < m; ++i) {
    for (size_t j = 0; j < n; ++j) {
      matrix[i * n + j] = f->derived.moment_arm[j * lanes + i];
    }
  }
  for (size_t at = 0; has_option(f, MODEL_DETECTS_BY_BANDS) && at < n * lanes; ++at) {
    f->derived.load_arm[at] = f->derived.moment_arm[at] * f->derived.stiffness[at % lanes];
  }
  pseudo_inverse(m, n, matrix, matrix);
  for (size_t j = 0; j < n; ++j) {
    memcpy(f->derived.inverse_routing + j * lanes, matrix + j * m, m * sizeof(double));
  }
}

void recall_sample(tendonfmu_finger* f) {
  memcpy(f->next, f->state + (f->state_count - f->next_count), f->next_count * sizeof(double));
  if (has_option(f, MODEL_HAS_SENSOR_FAULT)) {
    use_rows(f, f->remembered.sensor.fault);
  }
  for (size_t slot = 0; slot < f->slots; ++slot) {
    f->scratch.view[slot / 4].key[slot % 4] = -1.0;
  }
}

void derive_numbers(tendonfmu_finger* finger, int routing_changed) {
  /* record 0 and 1 stay zero: edges without friction */
  derivation d = {.finger = finger, .values = finger->parameters, .next_record = 2};
  finger->derived.settings = (finger_settings){
      .initial_variance = -1.0, .noise_time = -1.0, .has_initial_torque = has_option(finger, MODEL_HAS_INITIAL_TORQUE)};
  clear_grids(finger);
  model_visit(&finger->shape, derive_item, &d);
  finger->derived.settings.cutoff_rate *= two_pi;
  if (has_option(finger, MODEL_HAS_LINKS)) {
    find_least_links(&finger->derived.links, finger->joints, finger->derived.least_link);
  }
  if (routing_changed) {
    derive_routing(finger);
    find_what_can_hold(finger);
  }
  find_extensions(finger);
  recall_sample(finger);
}

void take_prepared_numbers(tendonfmu_finger* finger, const tendonfmu_finger* prepared) {
  memmove(finger->parameters, prepared->parameters, finger->prepared_bytes);
  finger->derived.settings = prepared->derived.settings;
  finger->memory.compliance = prepared->memory.compliance;
  finger->memory.relaxes = prepared->memory.relaxes;
  finger->memory.step = prepared->memory.step;
  recall_sample(finger);
}

/* --- the laws in force at a slot ---------------------------------------------------------------------------------- */

size_t slot_segment(const tendonfmu_finger* finger, size_t joint, size_t tendon, double angle) {
  const size_t first = finger->derived.edge_angle_row[joint] + tendon;
  size_t passed = 0;
  for (size_t k = 0; k < finger->shape.most_points[joint]; ++k) {
    const double at = finger->derived.edge_angle[first + k * finger->tendon_lanes];
    passed += angle >= at && at < INFINITY; /* an angle of an overflowing sample may be infinite, too */
  }
  return passed;
}

effect_laws edge_laws(const tendonfmu_finger* finger, size_t joint, size_t tendon, dual angle) {
  const derived_numbers* d = &finger->derived;
  const size_t slot = joint * finger->tendon_lanes + tendon;
  const size_t record = d->edge_record[slot] + slot_segment(finger, joint, tendon, angle.value);
  const double *segment = d->edge_segment + 2 * record, *law = d->edge_law + record * LAW_NUMBERS;
  return (effect_laws){.below = law,
                       .above = law + LAW_NUMBERS,
                       .weight = {(angle.value - segment[0]) * segment[1], angle.slope * segment[1]}};
}

static dual law_at(const double* law, int negative, dual speed) {
  const law_slopes of = law_with_slopes(law + negative * LAW_SIDE_NUMBERS, speed.value);
  return (dual){of.value, of.by_speed * speed.slope};
}

dual magnitude_at(const effect_laws* laws, int negative, dual speed) {
  const dual below = law_at(laws->below, negative, speed);
  if (!laws->above) {
    return below;
  }
  return sum(below, product(laws->weight, difference(law_at(laws->above, negative, speed), below)));
}

static void put_side(double rows[LAW_SIDE_NUMBERS][4], size_t lane, const double* law, int negative) {
  for (int k = 0; k < LAW_SIDE_NUMBERS; ++k) {
    rows[k][lane] = law[negative * LAW_SIDE_NUMBERS + k];
  }
}

static void fill_joint_lane(const derived_numbers* d, size_t joint, size_t lane, int negative, slot_view* view) {
  put_side(view->below, lane, d->joint_law + joint * LAW_NUMBERS, negative);
  put_side(view->other, lane, d->load_law + joint * LAW_NUMBERS, negative);
  view->low[lane] = -INFINITY;
  view->high[lane] = INFINITY;
}

/* returns whether it stands between two working points */
static int fill_tendon_lane(const tendonfmu_finger* f, size_t joint, size_t tendon, double angle, size_t lane,
                            int negative, slot_view* view) {
  const derived_numbers* d = &f->derived;
  const size_t slot = joint * f->tendon_lanes + tendon;
  const size_t passed = slot_segment(f, joint, tendon, angle), points = f->shape.most_points[joint];
  const size_t record = d->edge_record[slot] + passed;
  const size_t first = d->edge_angle_row[joint] + tendon, lanes = f->tendon_lanes;
  put_side(view->below, lane, d->edge_law + record * LAW_NUMBERS, negative);
  put_side(view->above, lane, d->edge_law + (record + 1) * LAW_NUMBERS, negative);
  put_side(view->other, lane, d->pulley_law + slot * LAW_NUMBERS, negative);
  view->low[lane] = passed > 0 ? d->edge_angle[first + (passed - 1) * lanes] : -INFINITY;
  view->high[lane] = passed < points ? d->edge_angle[first + passed * lanes] : INFINITY;
  view->begin[lane] = d->edge_segment[2 * record];
  view->inverse_length[lane] = d->edge_segment[2 * record + 1];
  return view->inverse_length[lane] != 0.0;
}

void slot_view_fill(const tendonfmu_finger* finger, size_t slot, size_t count, double angle, int negative,
                    slot_view* view) {
  const size_t joint = slot / finger->tendon_lanes, tendon = slot % finger->tendon_lanes, first = slot % 4;
  view->blends[first] = 0.0;
  for (size_t k = 0; k < count; ++k) {
    const int side = negative >> k & 1;
    if (joint >= finger->joints) {
      fill_joint_lane(&finger->derived, slot - finger->joints * finger->tendon_lanes + k, first + k, side, view);
    } else if (fill_tendon_lane(finger, joint, tendon + k, angle, first + k, side, view)) {
      view->blends[first] = 1.0;
    }
  }
  view->key[first] = negative;
}
