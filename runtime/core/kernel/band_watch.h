/* The bands of a joint side by side (docs/reference/semantics/detection.md): what they remember, and how much of its
 * bound each has. */
#pragma once

#include "contact_bands.h"
#include "quad.h"

#define RESERVE_BAND 2

/* means of a value, and the means of those */
HOT_INLINE void follow_value(double* mean, double* reference, size_t k, double value, quad quick, quad slow) {
  const quad before = quad_load(mean + k), now = before + quick * (value - before), behind = quad_load(reference + k);
  quad_store(mean + k, now);
  quad_store(reference + k, behind + slow * (now - behind));
}

/* σ of some means of a joint that began `age` ago: means of what there has been since */
HOT_INLINE quad share_since(const double* time, const double* share, size_t k, double age, double young) {
  return quad_select(quad_greater(quad_load(time + k), quad_set(age)), quad_set(young), quad_load(share + k));
}

static void follow_bands(band_memory* joint, const band_sample* sample, const band_shares* shares, double young,
                         double age, int any) {
  for (size_t k = 0; k < BANDS; k += QUAD_LANES) {
    const quad quick = share_since(band_mean_time, shares->mean, k, age, young);
    const quad slow = share_since(band_reference_time, shares->reference, k, age, young);
    const quad kept = quad_load(shares->kept + k);
    follow_value(joint->mean, joint->reference, k, sample->residual, quick, any ? quad_set(shares->held) : slow);
    follow_value(joint->load, joint->load_reference, k, sample->load, quick, slow);
    follow_value(joint->torque, joint->torque_reference, k, sample->torque, quick, slow);
    const quad driven = quad_abs(quad_load(joint->load + k) - quad_load(joint->load_reference + k));
    quad_store(joint->driven + k, quad_max(quad_load(joint->driven + k) * kept, driven));
    quad_store(joint->reserve + k, quad_max(quad_load(joint->reserve + k) * kept, quad_set(sample->reserve)));
  }
}

/* the terms of some bands */
HOT_INLINE void find_terms(const band_memory* joint, size_t k, quad terms[BAND_TERMS]) {
  const quad mean = quad_load(joint->mean + k), change = mean - quad_load(joint->reference + k);
  const quad driven = quad_load(joint->driven + k), all_driven = quad_set(joint->driven[RESERVE_BAND]);
  const quad from_home = quad_with_sign(mean - joint->home, change);
  const quad size = quad_max(quad_set(0.0), quad_min(quad_abs(change), from_home));
  const quad turned = quad_abs(quad_load(joint->torque + k) - quad_load(joint->torque_reference + k));
  terms[0] = change;
  terms[1] = quad_with_sign(quad_abs(size), change);
  terms[2] = quad_set(1.0);
  terms[3] = quad_set(joint->friction);
  terms[4] = quad_set(joint->limit);
  terms[5] = driven;
  terms[6] = quad_min(turned, driven);
  terms[7] = quad_min(quad_load(joint->reserve + k), all_driven);
}

static double weigh_bands(const band_memory* joint, const double* squares, double* terms, size_t* band) {
  _Alignas(32) double size[BANDS], bound[BANDS];
  double most = 0.0, bound_of_most = 1.0;
  const double unknown = band_unknown(joint);
  for (size_t k = 0; k < BANDS; k += QUAD_LANES) {
    quad row[BAND_TERMS], sum = quad_set(unknown * unknown);
    find_terms(joint, k, row);
    for (size_t i = 0; i < BAND_TERMS; ++i) {
      quad_store(terms + i * BANDS + k, row[i]);
    }
    for (size_t i = 0; i < BAND_NUMBERS; ++i) {
      sum += quad_load(squares + i * BANDS + k) * (row[2 + i] * row[2 + i]);
    }
    quad_store(bound + k, sum);
    quad_store(size + k, row[1] * row[1]);
  }
  *band = 0;
  for (size_t k = 0; k < BANDS; ++k) {
    if (size[k] * bound_of_most > most * bound[k]) { /* one division for all bands */
      most = size[k];
      bound_of_most = bound[k];
      *band = k;
    }
  }
  return most / bound_of_most;
}
