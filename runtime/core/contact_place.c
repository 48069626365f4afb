#include "floating_point.h"

#include "contact_place.h"

#include <math.h>

#include "pseudo_inverse.h"
#include "sensor_fault.h"

static const double told_share = 0.01;     /* of the largest eigenvalue: a tenth of the standard deviation's inverse */
static const double least_square = 1e-200; /* of levers: below it a quotient by it may overflow */
static const double turning_share = 1e-8;  /* above it a force along the direction turns joints at all */
static const double stands_out = 5.0;      /* standard deviations */
static const double largest_misfit = 1e12;
static const double largest_torque = 1e30; /* N·m, far beyond what inputs make; a restored state may hold any */

/* Weights of the joints in Σ w²·(torque + lever · F)², multiples of the smallest deviation, none above 1; returns that
 * one. */
static double weigh_joints(size_t joints, const double* deviation, double* weight) {
  double smallest = deviation ? deviation[0] : 1.0;
  for (size_t j = 1; deviation && j < joints; ++j) {
    smallest = deviation[j] < smallest ? deviation[j] : smallest;
  }
  for (size_t j = 0; j < joints; ++j) {
    weight[j] = deviation ? smallest / deviation[j] : 1.0;
  }
  return smallest;
}

/* Σ a_j·b_j over the joints */
static double dot(size_t joints, const double* a, const double* b) {
  double sum = 0.0;
  for (size_t j = 0; j < joints; ++j) {
    sum += a[j] * b[j];
  }
  return sum;
}

/* The problem turned to its principal directions: what a unit of force along each makes of the weighted torques. */
typedef struct principal {
  double torque[3 * MODEL_MAX_JOINTS]; /* [3 × joints], orthogonal */
  double direction[9];                 /* [3 × 3], one a row */
  double value[3], largest;            /* squared lengths of torque */
  double pull[3];                      /* of the weighted torques along them */
} principal;

static principal find_principal(size_t joints, const double* lever, const double* torque, const double* weight) {
  principal of;
  double weighted[MODEL_MAX_JOINTS];
  for (size_t j = 0; j < joints; ++j) {
    for (size_t i = 0; i < 3; ++i) {
      of.torque[i * joints + j] = weight[j] * lever[3 * j + i];
    }
    weighted[j] = weight[j] * torque[j];
  }
  orthogonal_columns(joints, 3, of.torque, of.direction);
  for (size_t k = 0; k < 3; ++k) {
    const double* along = of.torque + k * joints;
    of.value[k] = dot(joints, along, along);
    of.pull[k] = -dot(joints, along, weighted);
  }
  of.largest = fmax(of.value[0], fmax(of.value[1], of.value[2]));
  return of;
}

static double least_sum(size_t joints, const double* lever, const double* torque, const double* deviation,
                        const double force[3]) {
  double sum = 0.0;
  for (size_t j = 0; j < joints; ++j, lever += 3) {
    const double left = torque[j] + lever[0] * force[0] + lever[1] * force[1] + lever[2] * force[2];
    sum += left / deviation[j] * (left / deviation[j]);
  }
  return sum;
}

tip_force find_tip_force(size_t joints, const double* lever, const double* torque, const double* deviation) {
  double weight[MODEL_MAX_JOINTS];
  const double smallest = weigh_joints(joints, deviation, weight);
  const principal of = find_principal(joints, lever, torque, weight);
  const double largest = of.largest;
  tip_force found = {.observable = 0};
  double best[3] = {0.0, 0.0, 0.0}, variance[3] = {0.0, 0.0, 0.0};
  int told = 0;
  size_t turning = 0;
  for (int k = 0; k < 3; ++k) {
    const double value = of.value[k], *e = of.direction + 3 * k;
    if (!(value > least_square && value >= turning_share * largest)) {
      continue;
    }
    const double along = of.pull[k] / value;
    const int tells = value >= told_share * largest;
    told += tells;
    ++turning;
    for (int i = 0; i < 3; ++i) {
      best[i] += along * e[i];
      found.force[i] += tells ? along * e[i] : 0.0;
      variance[i] += tells ? e[i] * e[i] * (largest / value) : 0.0; /* a share, so that it stays finite */
    }
  }
  found.observable = told == 3;
  for (int i = 0; deviation && i < 3; ++i) {
    found.deviation[i] = told ? smallest * sqrt(variance[i]) / sqrt(largest) : 0.0;
  }
  if (deviation && joints > turning) {
    found.misfit = fmin(largest_misfit, least_sum(joints, lever, torque, deviation, best) / (double)(joints - turning));
  }
  return found;
}

int find_contact_link(size_t joints, const int* least, const double* torque, const double* deviation) {
  for (size_t j = joints; deviation && j-- > 0;) {
    if (fabs(torque[j]) > stands_out * deviation[j]) {
      return least[j];
    }
  }
  return -1;
}

/* compensated_torque_std of all joints; NULL where it is not known */
static const double* find_deviations(const tendonfmu_finger* f, double* deviation) {
  int known = has_option(f, MODEL_HAS_DEVIATION);
  for (size_t j = 0; j < f->joints; ++j) {
    deviation[j] = sqrt(f->remembered.total_variance[j]);
    known = known && deviation[j] > 0.0;
  }
  return known ? deviation : NULL;
}

contact_place find_contact_place(const tendonfmu_finger* finger) {
  const finger_state* s = &finger->remembered;
  const size_t n = finger->joints;
  double lever[3 * MODEL_MAX_JOINTS], room[MODEL_MAX_JOINTS] = {0.0}, torque[MODEL_MAX_JOINTS] = {0.0};
  contact_place found = {.link = 0};
  if (has_option(finger, MODEL_HAS_LINKS)) {
    const double* deviation = find_deviations(finger, room);
    find_tip_levers(&finger->derived.links, n, s->angle, lever);
    for (size_t j = 0; j < n; ++j) {
      torque[j] = fmax(-largest_torque, fmin(largest_torque, s->compensated[j]));
    }
    found.tip = find_tip_force(n, lever, torque, deviation);
    if (s->scalar[STATE_CONTACT] != 0.0) {
      found.link = find_contact_link(n, finger->derived.least_link, torque, deviation);
    }
    if (any_joint_is_blind(finger)) { /* its torque is not that of the finger */
      found.tip.observable = 0;
      found.link = found.link ? -1 : 0;
    }
  }
  return found;
}
