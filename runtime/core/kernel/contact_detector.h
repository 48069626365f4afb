/* Contact: a joint whose residual exceeds its threshold (paper VI), or whose innovation exceeds what noise and friction
 * can make of it (docs/reference/semantics/detection.md#contact-detector). */
#pragma once

#include "contact_at_rest.h"
#include "contact_drift.h"

/* base_j + per_force_j·mean|f0| */
HOT_INLINE quad force_dependent(const double* base, const double* per_force, size_t j, double mean_force) {
  return quad_add(quad_load(base + j), quad_mul(quad_load(per_force + j), quad_set(mean_force)));
}

/* E: what friction may hide, four joints */
HOT_INLINE quad hidden_torque(const tendonfmu_finger* f, size_t j) {
  const finger_settings* settings = &f->derived.settings;
  const quad stuck = quad_mul(quad_set(settings->stuck_share), quad_load(f->remembered.stuck_friction + j));
  const quad jump = quad_mul(quad_set(settings->jump_share), quad_load(f->remembered.friction_jump + j));
  const quad hidden = quad_add(stuck, jump);
  return start_is_open(f) ? quad_add(hidden, quad_load(f->remembered.unlearned + j)) : hidden;
}

/* g of the CUSUM: time, weighted by how far the innovation is beyond its bound */
HOT_INLINE quad gather_evidence(tendonfmu_finger* f, size_t j, quad innovation, quad bound, double step) {
  const quad zero = quad_set(0.0), most = quad_set(10.0);
  const quad beyond = quad_sub(innovation, bound);
  const quad_mask has_bound = quad_greater(bound, zero);
  const quad ratio = quad_div(innovation, quad_select(has_bound, bound, quad_set(1.0)));
  const quad measured = quad_sub(ratio, quad_set(1.0));
  const quad unbounded = quad_select(quad_greater(beyond, zero), most, quad_set(-1.0));
  const quad rate = quad_min(quad_select(has_bound, measured, unbounded), most);
  const quad sum = quad_add(quad_load(f->remembered.evidence + j), quad_mul(quad_set(step), rate));
  const quad evidence =
      quad_keep(quad_greater(sum, zero), quad_min(sum, quad_set(2.0 * f->derived.settings.evidence_time)));
  quad_store(f->remembered.evidence + j, evidence);
  return evidence;
}

/* lanes whose innovation y = r − m, or the evidence gathered from it, exceeds */
HOT_INLINE quad_mask innovation_exceeds(tendonfmu_finger* f, size_t j, quad ratio, double mean_force, double step) {
  const finger_state* s = &f->remembered;
  const double evidence_time = f->derived.settings.evidence_time;
  const quad innovation = quad_sub(quad_load(s->residual + j), quad_load(s->tracked + j));
  const quad base = force_dependent(f->derived.innovation_threshold, f->derived.innovation_per_force, j, mean_force);
  const quad bound = quad_add(base, hidden_torque(f, j));
  quad_store(s->innovation + j, innovation);
  if (evidence_time < 0.0) {
    return quad_greater(quad_abs(innovation), quad_mul(ratio, bound));
  }
  const quad evidence = gather_evidence(f, j, quad_abs(innovation), bound, step);
  return quad_greater(evidence, quad_mul(ratio, quad_set(evidence_time)));
}

/* lanes whose residual exceeds */
HOT_INLINE quad_mask residual_exceeds(const tendonfmu_finger* f, size_t j, quad ratio, double mean_force) {
  const finger_settings* settings = &f->derived.settings;
  quad bound = force_dependent(f->derived.contact_threshold, f->derived.contact_per_force, j, mean_force);
  if (settings->bounds_friction || start_is_open(f)) {
    bound = quad_add(bound, hidden_torque(f, j));
  }
  if (settings->knows_uncertainty) {
    const quad uncertainty = quad_load(f->scratch.uncertainty + j);
    bound = quad_add(bound, quad_mul(quad_set(settings->uncertainty_level), uncertainty));
  }
  return quad_greater(quad_abs(quad_load(f->remembered.residual + j)), quad_mul(ratio, bound));
}

/* lanes that have drifted too far */
HOT_INLINE quad_mask drift_exceeds(const tendonfmu_finger* f, size_t j, quad ratio, double mean_force) {
  quad bound = force_dependent(f->derived.drift_threshold, f->derived.drift_per_force, j, mean_force);
  if (start_is_open(f)) {
    bound = quad_add(bound, quad_load(f->remembered.unlearned + j));
  }
  return quad_greater(quad_abs(quad_load(f->remembered.drift + j)), quad_mul(ratio, bound));
}

/* Into joint_contact, from the residuals; returns whether any joint is in contact. Lanes without a joint have residual
 * and bounds of 0 and are never. */
HOT_INLINE int detect_contact(tendonfmu_finger* f, double mean_force, double time, double step) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  const quad held = quad_set(settings->hold_time + CLOCK_ROUNDING * step);
  const quad now = quad_set(time), one = quad_set(1.0), release = quad_set(settings->release_ratio);
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad_mask before = quad_greater(quad_load(s->joint_contact + j), quad_set(0.5));
    const quad ratio = quad_select(before, release, one);
    quad_mask exceeds = residual_exceeds(f, j, ratio, mean_force);
    if (settings->uses_innovation) {
      exceeds = quad_either(exceeds, innovation_exceeds(f, j, ratio, mean_force, step));
    }
    if (settings->watches_drift) {
      exceeds = quad_either(exceeds, drift_exceeds(f, j, ratio, mean_force));
    }
    if (settings->watches_rest) {
      exceeds = quad_either(exceeds, loaded_since_rest(f, j));
    }
    const quad exceeded_at = quad_select(exceeds, now, quad_load(s->exceeded_at + j));
    const quad_mask recent = quad_at_least(held, quad_sub(now, exceeded_at));
    const quad_mask contact = quad_either(exceeds, quad_both(before, recent));
    quad_store(s->exceeded_at + j, exceeded_at);
    quad_store(s->joint_contact + j, quad_keep(contact, one));
    any |= quad_mask_bits(contact);
  }
  return any != 0;
}

/* whether the bias is updated at this sample: without contact, or in one that has lasted too long; time in contact at
 * rest does not count */
HOT_INLINE int bias_is_updated(tendonfmu_finger* f, int contact, double time, double step) {
  const finger_state* s = &f->remembered;
  const double release_time = f->derived.settings.release_time;
  if (contact && (s->scalar[STATE_CONTACT] == 0.0 || s->scalar[STATE_CONTACT_AT_REST] != 0.0)) {
    s->scalar[STATE_CONTACT_SINCE] = time;
  }
  const double lasted = time - s->scalar[STATE_CONTACT_SINCE] + CLOCK_ROUNDING * step;
  return !contact || (release_time >= 0.0 && lasted >= release_time);
}

/* m follows the residual of step 5 */
HOT_INLINE void follow_residual(tendonfmu_finger* f, double step) {
  const finger_state* s = &f->remembered;
  const quad share = quad_set(law_one_minus_exponential(step / f->derived.settings.innovation_time));
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad tracked = quad_load(s->tracked + j);
    const quad distance = quad_sub(quad_load(s->residual + j), tracked);
    quad_store(s->tracked + j, quad_add(tracked, quad_mul(share, distance)));
  }
}

/* square of compensated_torque_std */
HOT_INLINE void estimate_variance(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  const finger_settings* settings = &f->derived.settings;
  const quad third = quad_set(1.0 / 3.0); /* variance of an even distribution within ±1 */
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad deviation = force_dependent(f->derived.deviation, f->derived.deviation_per_force, j, mean_force);
    quad total = quad_add(with_unlearned(f, j, quad_load(s->variance + j)), quad_mul(deviation, deviation));
    if (settings->knows_uncertainty) {
      const quad uncertainty = quad_load(f->scratch.uncertainty + j);
      total = quad_add(total, quad_mul(uncertainty, uncertainty));
    }
    if (settings->bounds_friction) {
      const quad stuck = quad_mul(quad_set(settings->stuck_share), quad_load(s->stuck_friction + j));
      const quad jump = quad_mul(quad_set(settings->jump_share), quad_load(s->friction_jump + j));
      total = quad_add(total, quad_mul(third, quad_add(quad_mul(stuck, stuck), quad_mul(jump, jump))));
    }
    quad_store(s->total_variance + j, total);
  }
}
