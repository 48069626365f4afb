/* Contact that rises slowly: what the modelled friction leaves drifts away from where it was
 * (docs/reference/semantics/detection.md#contact-detector). */
#pragma once

#include "bias_tracker.h"

#define DRIFT_OF_LATE 0.1 /* of T_q: the time of the mean o */

/* the weights of e in the means o, p and s: 1 − exp(−Δt/min(T, time since the start)), into scratch */
HOT_INLINE void find_drift_shares(tendonfmu_finger* f, double time, double step) {
  const finger_settings* settings = &f->derived.settings;
  const double quick = settings->drift_quick_time;
  const double constant[4] = {DRIFT_OF_LATE * quick, quick, settings->drift_slow_time, 1.0};
  const double since_start = time - f->remembered.scalar[STATE_STARTED_AT];
  _Alignas(32) double age[4];
  for (int k = 0; k < 4; ++k) {
    age[k] = since_start < constant[k] ? since_start : constant[k];
  }
  quad_store(f->scratch.drift_share, approach_share(quad_div(quad_set(step), quad_load(age))));
}

/* e = r + c, four joints: what friction leaves, what the bias has learned since the start put back */
HOT_INLINE quad left_by_friction(const tendonfmu_finger* f, size_t j) {
  return quad_add(quad_load(f->remembered.residual + j), quad_load(f->remembered.learned + j));
}

/* one step of an exponential mean */
HOT_INLINE quad approach(double* mean, quad value, quad share) {
  const quad before = quad_load(mean), after = quad_add(before, quad_mul(share, quad_sub(value, before)));
  quad_store(mean, after);
  return after;
}

/* the smaller of two numbers of one sign, else 0 */
HOT_INLINE quad common_part(quad a, quad b) {
  const quad_mask same = quad_greater(quad_mul(a, b), quad_set(0.0));
  return quad_keep(same, quad_with_sign(quad_min(quad_abs(a), quad_abs(b)), a));
}

/* o and p follow e; d is what p − s and o − s have in common: it ends as the load does, and single samples are no load.
 * Before contact is decided. */
HOT_INLINE void watch_drift(tendonfmu_finger* f, double time, double step) {
  const finger_state* s = &f->remembered;
  find_drift_shares(f, time, step);
  const quad share_of_late = quad_set(f->scratch.drift_share[0]), share = quad_set(f->scratch.drift_share[1]);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad left = left_by_friction(f, j), slow = quad_load(s->drift_slow + j);
    const quad of_late = approach(s->drift_of_late + j, left, share_of_late);
    const quad quick = approach(s->drift_quick + j, left, share);
    quad_store(s->drift + j, common_part(quad_sub(quick, slow), quad_sub(of_late, slow)));
  }
}

/* What the bias learns in this update of how friction stood at the start: no drift. Four joints. */
HOT_INLINE quad learned_of_start(const tendonfmu_finger* f, size_t j, quad predicted, quad own_gain, quad noise) {
  const quad whole = kalman_gain(with_unlearned(f, j, predicted), noise);
  return quad_mul(quad_sub(whole, own_gain), quad_load(f->remembered.residual + j));
}

/* s and c follow, before the bias is updated; in a contact that has lasted too long s begins anew at p */
HOT_INLINE void follow_drift(tendonfmu_finger* f, int contact, double step, double noise) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  const quad drift_variance = quad_set(settings->drift_variance * step), noise_now = quad_set(noise);
  const double* share = f->scratch.drift_share;
  const quad share_of_late = quad_set(share[0]), quick_share = quad_set(share[1]), slow_share = quad_set(share[2]);
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad predicted = quad_add(quad_load(s->variance + j), drift_variance);
    const quad gain = kalman_gain(predicted, noise_now), learned = quad_mul(gain, quad_load(s->residual + j));
    quad left = left_by_friction(f, j), quick = quad_load(s->drift_quick + j);
    if (start_is_open(f)) {
      const quad of_start = learned_of_start(f, j, predicted, gain, noise_now);
      left = quad_sub(left, of_start);
      quick = quad_sub(quick, quad_mul(quick_share, of_start));
      quad_store(s->drift_quick + j, quick);
      const quad of_late = quad_load(s->drift_of_late + j);
      quad_store(s->drift_of_late + j, quad_sub(of_late, quad_mul(share_of_late, of_start)));
    }
    approach(s->drift_slow + j, contact ? quick : left, contact ? quad_set(1.0) : slow_share);
    const quad sum = quad_add(quad_load(s->learned + j), learned);
    quad_store(s->learned + j, quad_with_sign(quad_min(quad_abs(sum), quad_set(LARGEST_SUM)), sum));
  }
}
