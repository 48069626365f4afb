// Moore-Penrose inverse of routing matrices.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core_inside.h"

namespace {

struct Matrix {
  std::size_t rows, columns;
  std::vector<double> a;

  Matrix(std::size_t r, std::size_t c) : rows(r), columns(c), a(r * c) {}
  Matrix(std::size_t r, std::size_t c, std::vector<double> numbers) : rows(r), columns(c), a(std::move(numbers)) {}
  double& operator()(std::size_t i, std::size_t j) { return a[i * columns + j]; }
  double operator()(std::size_t i, std::size_t j) const { return a[i * columns + j]; }
  double largest() const {
    double most = 0.0;
    for (const double x : a) {
      most = std::max(most, std::abs(x));
    }
    return most;
  }
};

Matrix operator*(const Matrix& a, const Matrix& b) {
  Matrix c(a.rows, b.columns);
  for (std::size_t i = 0; i < a.rows; ++i) {
    for (std::size_t j = 0; j < b.columns; ++j) {
      for (std::size_t k = 0; k < a.columns; ++k) {
        c(i, j) += a(i, k) * b(k, j);
      }
    }
  }
  return c;
}

Matrix transposed(const Matrix& a) {
  Matrix t(a.columns, a.rows);
  for (std::size_t i = 0; i < a.rows; ++i) {
    for (std::size_t j = 0; j < a.columns; ++j) {
      t(j, i) = a(i, j);
    }
  }
  return t;
}

Matrix inverse(const Matrix& a, std::size_t* rank = nullptr) {
  Matrix b(a.columns, a.rows), in_place(a.columns, a.rows);
  in_place.a = a.a;
  const std::size_t found = pseudo_inverse(a.rows, a.columns, a.a.data(), b.a.data());
  EXPECT_EQ(pseudo_inverse(a.rows, a.columns, in_place.a.data(), in_place.a.data()), found);
  EXPECT_EQ(in_place.a, b.a);
  if (rank) {
    *rank = found;
  }
  return b;
}

double distance(const Matrix& a, const Matrix& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.a.size(); ++i) {
    most = std::max(most, std::abs(a.a[i] - b.a[i]));
  }
  return most;
}

Matrix random_matrix(std::size_t rows, std::size_t columns, std::mt19937_64& random) {
  Matrix a(rows, columns);
  for (double& x : a.a) {
    x = std::normal_distribution<>()(random);
  }
  return a;
}

// The four conditions that define A⁺; errors grow with the condition number.
void expect_penrose(const Matrix& a, const Matrix& b, double tolerance) {
  EXPECT_LT(distance(a * b * a, a), tolerance * a.largest());
  EXPECT_LT(distance(b * a * b, b), tolerance * b.largest());
  EXPECT_LT(distance(transposed(a * b), a * b), tolerance);
  EXPECT_LT(distance(transposed(b * a), b * a), tolerance);
}

TEST(PseudoInverse, KeepsPenrosesConditionsForRandomMatricesOfEverySize) {
  std::mt19937_64 random(11);
  for (const std::size_t columns : {1, 2, 3, 4, 8, 16}) {
    for (const std::size_t rows : {1, 2, 4, 5, 8, 16, 33, 64}) {
      std::size_t rank = 0;
      const Matrix a = random_matrix(rows, columns, random), b = inverse(a, &rank);
      EXPECT_EQ(rank, std::min(rows, columns)) << rows << " x " << columns;
      expect_penrose(a, b, 1e-10);
    }
  }
}

TEST(PseudoInverse, CountsExactlyDependentColumnsOut) {
  std::mt19937_64 random(14);
  for (int trial = 0; trial < 50; ++trial) {
    Matrix a = random_matrix(8, 4, random);
    for (std::size_t i = 0; i < 8; ++i) {
      a(i, 3) = 2.0 * a(i, 1); /* exact in binary */
    }
    std::size_t rank = 0;
    const Matrix b = inverse(a, &rank);
    EXPECT_EQ(rank, 3u);
    expect_penrose(a, b, 1e-11);
  }
}

TEST(PseudoInverse, OfZerosIsZeroOfRankZero) {
  std::size_t rank = 9;
  const Matrix b = inverse(Matrix(4, 3), &rank);
  EXPECT_EQ(rank, 0u);
  EXPECT_EQ(b.largest(), 0.0);
}

}  // namespace
