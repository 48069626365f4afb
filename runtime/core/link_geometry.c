#include "floating_point.h"

#include "link_geometry.h"

#include <math.h>
#include <string.h>

#include "elementary.h"
#include "model_image.h"

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double product[3]) {
  product[0] = a[1] * b[2] - a[2] * b[1];
  product[1] = a[2] * b[0] - a[0] * b[2];
  product[2] = a[0] * b[1] - a[1] * b[0];
}

void make_unit(double vector[3]) {
  const double largest = fmax(fabs(vector[0]), fmax(fabs(vector[1]), fabs(vector[2])));
  for (int k = 0; k < 3; ++k) {
    vector[k] /= largest; /* so that no square is lost or too large */
  }
  const double length = sqrt(dot(vector, vector));
  for (int k = 0; k < 3; ++k) {
    vector[k] /= length;
  }
}

/* The axes of a link in the base frame are the columns of its frame. */
typedef struct rotation {
  double column[3][3];
} rotation;

static void to_base(const rotation* frame, const double own[3], double base[3]) {
  for (int k = 0; k < 3; ++k) {
    base[k] = frame->column[0][k] * own[0] + frame->column[1][k] * own[1] + frame->column[2][k] * own[2];
  }
}

/* turned about a unit vector in its own frame (Rodrigues) */
static void turn(rotation* frame, const double axis[3], double angle) {
  const sine_cosine of = sine_cosine_of(angle);
  const double s = of.sine, c = of.cosine;
  const rotation before = *frame;
  for (int k = 0; k < 3; ++k) {
    const double unit[3] = {k == 0, k == 1, k == 2};
    double across[3];
    cross(axis, unit, across);
    double turned[3];
    for (int i = 0; i < 3; ++i) {
      turned[i] = (i == k ? c : 0.0) + (1.0 - c) * axis[k] * axis[i] + s * across[i];
    }
    to_base(&before, turned, frame->column[k]);
  }
}

static void add(double sum[3], const double term[3]) {
  for (int k = 0; k < 3; ++k) {
    sum[k] += term[k];
  }
}

void find_tip_levers(const link_geometry* geometry, size_t joints, const double* angle, double* lever) {
  rotation frame = {{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
  double axis[MODEL_MAX_JOINTS][3], origin[MODEL_MAX_JOINTS][3], place[3] = {0.0, 0.0, 0.0}, way[3];
  for (size_t j = 0; j < joints; ++j) {
    to_base(&frame, geometry->offset + 3 * j, way);
    add(place, way);
    memcpy(origin[j], place, sizeof place);
    to_base(&frame, geometry->axis + 3 * j, axis[j]);
    turn(&frame, geometry->axis + 3 * j, angle[j]);
  }
  to_base(&frame, geometry->tip, way);
  add(place, way);
  for (size_t j = 0; j < joints; ++j) {
    const double arm[3] = {place[0] - origin[j][0], place[1] - origin[j][1], place[2] - origin[j][2]};
    cross(axis[j], arm, lever + 3 * j);
  }
}

static int has_lever(const double axis[3], const double end[3]) {
  double lever[3];
  cross(axis, end, lever);
  return sqrt(dot(lever, lever)) > 1e-9 * sqrt(dot(end, end));
}

void find_least_links(const link_geometry* geometry, size_t joints, int* least) {
  int reached = (int)joints;
  for (size_t j = joints; j-- > 0;) {
    const double* end = j + 1 < joints ? geometry->offset + 3 * (j + 1) : geometry->tip;
    if (has_lever(geometry->axis + 3 * j, end)) {
      reached = (int)j + 1;
    }
    least[j] = reached;
  }
}
