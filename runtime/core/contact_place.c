#include "floating_point.h"

#include "contact_place.h"

#include <math.h>

#include "sensor_fault.h"

static const double told_share = 0.01;     /* of the largest eigenvalue: a tenth of the standard deviation's inverse */
static const double least_square = 1e-200; /* of levers: below it a quotient by it may overflow */
static const double turning_share = 1e-8;  /* above it a force along the direction turns joints at all */
static const double stands_out = 5.0;      /* standard deviations */
static const double largest_misfit = 1e12;
static const double largest_torque = 1e30; /* N·m, far beyond what inputs make; a restored state may hold any */

enum { MAX_SWEEPS = 30 };

/* A symmetric matrix on its way to a diagonal one, and what it was turned by. */
typedef struct spectrum {
  double matrix[3][3];    /* the eigenvalues on the diagonal at the end */
  double direction[3][3]; /* eigenvector k */
  double trace;           /* which no rotation changes */
} spectrum;

/* Jacobi's rotation, which makes element (p, q) zero; returns 0 when it is as good as that */
static int rotate(spectrum* s, int p, int q) {
  const double pp = s->matrix[p][p], qq = s->matrix[q][q], pq = s->matrix[p][q];
  if (fabs(pq) <= 1e-17 * s->trace) {
    return 0;
  }
  const double zeta = (qq - pp) / (2.0 * pq);
  const double tangent = copysign(1.0, zeta) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
  const double cosine = 1.0 / sqrt(1.0 + tangent * tangent), sine = cosine * tangent;
  const int other = 3 - p - q;
  const double po = s->matrix[p][other], qo = s->matrix[q][other];
  s->matrix[p][p] = fmax(0.0, pp - tangent * pq);
  s->matrix[q][q] = fmax(0.0, qq + tangent * pq);
  s->matrix[p][q] = s->matrix[q][p] = 0.0;
  s->matrix[p][other] = s->matrix[other][p] = cosine * po - sine * qo;
  s->matrix[q][other] = s->matrix[other][q] = sine * po + cosine * qo;
  for (int i = 0; i < 3; ++i) {
    const double old = s->direction[p][i];
    s->direction[p][i] = cosine * old - sine * s->direction[q][i];
    s->direction[q][i] = sine * old + cosine * s->direction[q][i];
  }
  return 1;
}

static void diagonalise(spectrum* s) {
  s->trace = s->matrix[0][0] + s->matrix[1][1] + s->matrix[2][2];
  for (int k = 0; k < 3; ++k) {
    s->direction[k][k] = 1.0;
  }
  for (int sweep = 0, turned = 1; turned && sweep < MAX_SWEEPS; ++sweep) {
    turned = rotate(s, 0, 1) | rotate(s, 0, 2) | rotate(s, 1, 2);
  }
}

/* One weighted least-squares problem: Σ w²·(torque + lever · F)². */
typedef struct problem {
  size_t joints;
  const double *lever, *torque, *deviation;
  double smallest; /* deviation, of which the weights are multiples: none is above 1 */
} problem;

static double weight(const problem* p, size_t joint) {
  return p->deviation ? p->smallest / p->deviation[joint] : 1.0;
}

static problem pose(size_t joints, const double* lever, const double* torque, const double* deviation) {
  problem p = {joints, lever, torque, deviation, 1.0};
  for (size_t j = 0; deviation && j < joints; ++j) {
    p.smallest = j == 0 || deviation[j] < p.smallest ? deviation[j] : p.smallest;
  }
  return p;
}

/* the normal equations: matrix, and pull = −Σ w²·lever·torque */
static void sum_up(const problem* p, spectrum* s, double pull[3]) {
  *s = (spectrum){.trace = 0.0};
  pull[0] = pull[1] = pull[2] = 0.0;
  for (size_t j = 0; j < p->joints; ++j) {
    const double *lever = p->lever + 3 * j, w = weight(p, j);
    for (int i = 0; i < 3; ++i) {
      pull[i] -= w * lever[i] * (w * p->torque[j]);
      for (int k = 0; k < 3; ++k) {
        s->matrix[i][k] += w * lever[i] * (w * lever[k]);
      }
    }
  }
}

static double least_sum(const problem* p, const double force[3]) {
  double sum = 0.0;
  for (size_t j = 0; j < p->joints; ++j) {
    const double* lever = p->lever + 3 * j;
    const double left = p->torque[j] + lever[0] * force[0] + lever[1] * force[1] + lever[2] * force[2];
    sum += left / p->deviation[j] * (left / p->deviation[j]);
  }
  return sum;
}

tip_force find_tip_force(size_t joints, const double* lever, const double* torque, const double* deviation) {
  const problem p = pose(joints, lever, torque, deviation);
  tip_force found = {.observable = 0};
  spectrum s;
  double pull[3], best[3] = {0.0, 0.0, 0.0}, variance[3] = {0.0, 0.0, 0.0};
  int told = 0;
  size_t turning = 0;
  sum_up(&p, &s, pull);
  diagonalise(&s);
  const double largest = fmax(s.matrix[0][0], fmax(s.matrix[1][1], s.matrix[2][2]));
  for (int k = 0; k < 3; ++k) {
    const double value = s.matrix[k][k], *e = s.direction[k];
    if (!(value > least_square && value >= turning_share * largest)) {
      continue;
    }
    const double along = (e[0] * pull[0] + e[1] * pull[1] + e[2] * pull[2]) / value;
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
    found.deviation[i] = told ? p.smallest * sqrt(variance[i]) / sqrt(largest) : 0.0;
  }
  if (deviation && joints > turning) {
    found.misfit = fmin(largest_misfit, least_sum(&p, best) / (double)(joints - turning));
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
  int known = (f->shape.options & MODEL_HAS_DEVIATION) != 0;
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
  if (finger->shape.options & MODEL_HAS_LINKS) {
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
