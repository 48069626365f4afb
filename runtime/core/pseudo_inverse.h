/* Moore-Penrose inverse of a routing matrix. */
#pragma once

#include <stddef.h>

/* matrix [rows × columns] and inverse [columns × rows], row-major, rows <= 64, columns <= 16; they may be one
 * array. Singular values below
 * 1e-15 times the largest count as zero. Returns the rank. One-sided Jacobi rotations: small singular values come out
 * with high relative accuracy (Demmel and Veselić 1992). */
size_t pseudo_inverse(size_t rows, size_t columns, const double* matrix, double* inverse);
