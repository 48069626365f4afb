#include "floating_point.h"

#include "pseudo_inverse.h"

#include <math.h>
#include <string.h>

enum { MAX_ROWS = 64, MAX_COLUMNS = 16, MAX_SWEEPS = 60 };

static double dot(size_t count, const double* a, const double* b) {
  double sum = 0.0;
  for (size_t i = 0; i < count; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

static void rotate(size_t count, double* a, double* b, double cosine, double sine) {
  for (size_t i = 0; i < count; ++i) {
    const double old = a[i];
    a[i] = cosine * old - sine * b[i];
    b[i] = sine * old + cosine * b[i];
  }
}

/* makes columns p and q of u orthogonal; returns 0 when they already are */
static int orthogonalise(size_t rows, size_t columns, size_t p, size_t q, double* u, double* v) {
  double *up = u + p * rows, *uq = u + q * rows;
  const double pp = dot(rows, up, up), qq = dot(rows, uq, uq), pq = dot(rows, up, uq);
  const double least = 1e-16 * sqrt(pp) * sqrt(qq), nothing = 1e-40 * (pp > qq ? pp : qq); /* zeta² stays finite */
  if (fabs(pq) <= (least > nothing ? least : nothing)) {
    return 0;
  }
  const double zeta = (qq - pp) / (2.0 * pq);
  const double tangent = copysign(1.0, zeta) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
  const double cosine = 1.0 / sqrt(1.0 + tangent * tangent);
  rotate(rows, up, uq, cosine, cosine * tangent);
  rotate(columns, v + p * columns, v + q * columns, cosine, cosine * tangent);
  return 1;
}

void orthogonal_columns(size_t rows, size_t columns, double* u, double* v) {
  memset(v, 0, columns * columns * sizeof *v);
  for (size_t j = 0; j < columns; ++j) {
    v[j * columns + j] = 1.0;
  }
  for (int sweep = 0, turned = 1; turned && sweep < MAX_SWEEPS; ++sweep) {
    turned = 0;
    for (size_t p = 0; p + 1 < columns; ++p) {
      for (size_t q = p + 1; q < columns; ++q) {
        turned |= orthogonalise(rows, columns, p, q, u, v);
      }
    }
  }
}

size_t pseudo_inverse(size_t rows, size_t columns, const double* matrix, double* inverse) {
  double u[MAX_COLUMNS * MAX_ROWS], v[MAX_COLUMNS * MAX_COLUMNS], sigma[MAX_COLUMNS], largest = 0.0;
  size_t rank = 0;
  for (size_t j = 0; j < columns; ++j) {
    for (size_t i = 0; i < rows; ++i) {
      u[j * rows + i] = matrix[i * columns + j];
    }
  }
  orthogonal_columns(rows, columns, u, v);
  for (size_t k = 0; k < columns; ++k) {
    sigma[k] = sqrt(dot(rows, u + k * rows, u + k * rows));
    largest = sigma[k] > largest ? sigma[k] : largest;
  }
  memset(inverse, 0, rows * columns * sizeof *inverse);
  for (size_t k = 0; k < columns; ++k) {
    if (!(sigma[k] > 1e-15 * largest)) {
      continue;
    }
    ++rank;
    for (size_t j = 0; j < columns; ++j) {
      const double scaled = v[k * columns + j] / sigma[k] / sigma[k];
      for (size_t i = 0; i < rows; ++i) {
        inverse[j * rows + i] += scaled * u[k * rows + i];
      }
    }
  }
  return rank;
}
