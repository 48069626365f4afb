#include "floating_point.h"

#include "finger_memory.h"

#include <math.h>

size_t slot_segment(const tendonfmu_finger* finger, size_t joint, size_t tendon, double angle) {
  const size_t first = finger->derived.edge_angle_row[joint] + tendon;
  size_t passed = 0;
  for (size_t k = 0; k < finger->shape.most_points[joint]; ++k) {
    const double at = finger->derived.edge_angle[first + k * finger->tendon_lanes];
    passed += angle >= at && at < INFINITY; /* an angle of an overflowing sample may be infinite, too */
  }
  return passed;
}

effect_laws edge_laws(const tendonfmu_finger* finger, size_t joint, size_t tendon, double angle, double angle_slope) {
  const derived_numbers* d = &finger->derived;
  const size_t slot = joint * finger->tendon_lanes + tendon;
  const size_t record = d->edge_record[slot] + slot_segment(finger, joint, tendon, angle);
  const double* segment = d->edge_segment + 2 * record;
  return (effect_laws){.below = d->edge_law + record * LAW_NUMBERS,
                       .above = d->edge_law + (record + 1) * LAW_NUMBERS,
                       .weight = (angle - segment[0]) * segment[1],
                       .weight_slope = angle_slope * segment[1]};
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
