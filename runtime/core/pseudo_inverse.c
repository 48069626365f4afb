#include "floating_point.h"

#include "pseudo_inverse.h"

#include <math.h>
#include <string.h>

enum { MAX_ROWS = 64, MAX_COLUMNS = 16, MAX_SWEEPS = 60 };

typedef struct factors {
  size_t rows, columns;
  double u[MAX_COLUMNS][MAX_ROWS];    /* columns of A·V: orthogonal at the end, with the singular values as lengths */
  double v[MAX_COLUMNS][MAX_COLUMNS]; /* columns of V */
} factors;

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

/* makes columns p and q orthogonal; returns 0 when they already are */
static int orthogonalise(factors* f, size_t p, size_t q) {
  const double pp = dot(f->rows, f->u[p], f->u[p]), qq = dot(f->rows, f->u[q], f->u[q]);
  const double pq = dot(f->rows, f->u[p], f->u[q]);
  if (fabs(pq) <= 1e-16 * sqrt(pp) * sqrt(qq)) {
    return 0;
  }
  const double zeta = (qq - pp) / (2.0 * pq);
  const double tangent = copysign(1.0, zeta) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
  const double cosine = 1.0 / sqrt(1.0 + tangent * tangent);
  rotate(f->rows, f->u[p], f->u[q], cosine, cosine * tangent);
  rotate(f->columns, f->v[p], f->v[q], cosine, cosine * tangent);
  return 1;
}

static void factorise(factors* f, const double* matrix) {
  for (size_t j = 0; j < f->columns; ++j) {
    for (size_t i = 0; i < f->rows; ++i) {
      f->u[j][i] = matrix[i * f->columns + j];
    }
    f->v[j][j] = 1.0;
  }
  for (int sweep = 0, turned = 1; turned && sweep < MAX_SWEEPS; ++sweep) {
    turned = 0;
    for (size_t p = 0; p + 1 < f->columns; ++p) {
      for (size_t q = p + 1; q < f->columns; ++q) {
        turned |= orthogonalise(f, p, q);
      }
    }
  }
}

size_t pseudo_inverse(size_t rows, size_t columns, const double* matrix, double* inverse) {
  factors f = {.rows = rows, .columns = columns};
  double sigma[MAX_COLUMNS], largest = 0.0;
  size_t rank = 0;
  factorise(&f, matrix);
  for (size_t k = 0; k < columns; ++k) {
    sigma[k] = sqrt(dot(rows, f.u[k], f.u[k]));
    largest = sigma[k] > largest ? sigma[k] : largest;
  }
  memset(inverse, 0, rows * columns * sizeof *inverse);
  for (size_t k = 0; k < columns; ++k) {
    if (!(sigma[k] > 1e-15 * largest)) {
      continue;
    }
    ++rank;
    for (size_t j = 0; j < columns; ++j) {
      const double scaled = f.v[k][j] / sigma[k] / sigma[k];
      for (size_t i = 0; i < rows; ++i) {
        inverse[j * rows + i] += scaled * f.u[k][i];
      }
    }
  }
  return rank;
}
