/* Contact: a joint whose residual exceeds its threshold (paper VI). */
#ifndef TENDONFMU_CONTACT_DETECTOR_H
#define TENDONFMU_CONTACT_DETECTOR_H

#include "finger_memory.h"

/* |τ_j − T_eff,j| > threshold_j + threshold_per_force_j·mean|f0|, into joint_contact; returns whether any joint is in
 * contact. Lanes without a joint have residual and threshold 0. */
HOT_INLINE int detect_contact(tendonfmu_finger* f, double mean_force) {
  const finger_state* s = &f->remembered;
  int any = 0;
  for (size_t j = 0; j < f->joint_lanes; j += 4) {
    const quad residual = quad_abs(quad_sub(quad_load(s->torque + j), quad_load(s->friction + j)));
    const quad per_force = quad_mul(quad_load(f->derived.contact_per_force + j), quad_set(mean_force));
    const quad_mask contact = quad_greater(residual, quad_add(quad_load(f->derived.contact_threshold + j), per_force));
    quad_store(s->joint_contact + j, quad_keep(contact, quad_set(1.0)));
    any |= quad_mask_bits(contact);
  }
  return any != 0;
}

#endif
