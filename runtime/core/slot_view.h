/* Which laws are in force at a slot: the side of each by the sign of its velocity, the working points by the joint
 * angle. */
#pragma once

#include "finger_memory.h"

/* Fills the view of `count` slots from `slot` on: its lanes from slot % 4 on.
 *   angle         of the joint before (q_0 = 0); of no meaning to the slots of joints
 *   negative      one bit a lane: the law's side for v < 0 */
void slot_view_fill(const tendonfmu_finger* finger, size_t slot, size_t count, double angle, int negative,
                    slot_view* view);

/* Segment of a grid in which an angle lies, as the number of working points at or below it. */
size_t slot_segment(const tendonfmu_finger* finger, size_t joint, size_t tendon, double angle);

/* Laws of one effect: a single one, or those of the segment between two working points. */
typedef struct effect_laws {
  const double *below, *above; /* above NULL: no working points */
  double weight, weight_slope; /* of the one above, and along a direction of the angle */
} effect_laws;

effect_laws edge_laws(const tendonfmu_finger* finger, size_t joint, size_t tendon, double angle, double angle_slope);
