/* Singular value decomposition by one-sided Jacobi rotations: small singular values come out with high relative
 * accuracy (Demmel and Veselić 1992). */
#pragma once

#include <stddef.h>

/* Turns the columns of a matrix A until they are orthogonal.
 *   u   [columns × rows], column by column: A; receives A·V, whose columns have the singular values as lengths
 *   v   [columns × columns] receives V, column by column */
void orthogonal_columns(size_t rows, size_t columns, double* u, double* v);

/* Moore-Penrose inverse of a routing matrix: matrix [rows × columns] and inverse [columns × rows], row-major,
 * rows <= 64, columns <= 16; they may be one array. Singular values below 1e-15 times the largest count as zero.
 * Returns the rank. */
size_t pseudo_inverse(size_t rows, size_t columns, const double* matrix, double* inverse);
