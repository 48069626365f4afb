/* The equation of presliding, four places at a time.
 *
 * F = ζ·|F(v)|, dζ = (s − ζ)·|dx|/D with s = sgn(dx), integrated exactly over each sample (Dahl 1968 with exponent 1).
 * D is the displacement at a place; of a row without one displacement·v_min, v_min being the effect's threshold. */
#pragma once

#include <float.h>

#include "effect.h"
#include "exponential.h"

/* What a place remembers: ζ, ∂ζ/∂displacement, ∂ζ by this sample's motion (the velocity, or the travel by a position
 * filter), and the share left of where ζ was before the sample. */
enum { PRESLIDING_SHARE, PRESLIDING_BY_DISPLACEMENT, PRESLIDING_BY_MOTION, PRESLIDING_KEPT, PRESLIDING_NUMBERS };

/* Four places. */
typedef struct presliding_places {
  quad displacement, distance; /* as in the description; D */
  quad travel;                 /* within the sample; 0 at the first one */
  quad by_motion;              /* ∂travel by the motion: s, 1 by a position filter */
  quad_mask has_slopes;        /* not at the first sample */
} presliding_places;

/* D of a place */
static inline double presliding_distance(effect_place place, double displacement, double threshold) {
  const double distance = displacement * threshold;
  if (!is_everywhere(place)) {
    return displacement;
  }
  return distance > DBL_MIN ? distance : DBL_MIN;
}

/* finite: no slope may be a reason to refuse a sample */
HOT_INLINE quad presliding_bounded(quad slope) {
  return quad_max(quad_set(-1e290), quad_min(quad_set(1e290), slope));
}

/* after ← what four places remember, from ζ and ∂ζ/∂displacement before */
HOT_INLINE void presliding_step(const presliding_places* p, quad share, quad by_displacement,
                                quad after[PRESLIDING_NUMBERS]) {
  const quad zero = quad_set(0.0), one = quad_set(1.0);
  const quad side = quad_select(quad_greater(zero, p->travel), quad_set(-1.0), one);
  const quad length = quad_abs(p->travel), ratio = quad_div(length, p->distance);
  const quad kept = exp_of_minus(ratio), left = quad_sub(side, share), left_after = quad_mul(left, kept);
  const quad_mask stands = quad_at_least(zero, length);
  /* nothing is left of where it was: slopes of 0, however short the displacement */
  const quad_mask lasts = quad_greater(quad_set(700.0), ratio);
  const quad shorter = presliding_bounded(quad_div(quad_mul(left, ratio), p->displacement));
  const quad slope = quad_mul(kept, quad_sub(by_displacement, shorter));
  const quad motion = quad_mul(quad_mul(left_after, side), p->by_motion);
  after[PRESLIDING_SHARE] = quad_select(stands, share, quad_sub(side, left_after));
  after[PRESLIDING_BY_DISPLACEMENT] = quad_keep(lasts, presliding_bounded(slope));
  after[PRESLIDING_BY_MOTION] =
      quad_keep(quad_both(lasts, p->has_slopes), presliding_bounded(quad_div(motion, p->distance)));
  after[PRESLIDING_KEPT] = quad_select(stands, one, kept);
}
