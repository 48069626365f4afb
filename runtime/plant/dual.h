/* Forward derivatives: a number with its derivatives along N directions. Used where a formula is long and rarely
 * differentiated, the rigid bodies; everything else is differentiated by hand. */
#pragma once

#include <array>
#include <cmath>

#include "elementary.h"

namespace tendonfmu::plant {

template <int N>
struct dual {
  double value = 0.0;
  std::array<double, N> slope{};

  dual() = default;
  dual(double constant) : value(constant) {}  // NOLINT: constants mix with duals

  dual& operator+=(const dual& other) { return *this = *this + other; }
  dual& operator-=(const dual& other) { return *this = *this - other; }
};

/* value with slope = a·x.slope + b·y.slope */
template <int N>
dual<N> combine(double value, double a, const dual<N>& x, double b, const dual<N>& y) {
  dual<N> result(value);
  for (int i = 0; i < N; ++i) {
    result.slope[i] = a * x.slope[i] + b * y.slope[i];
  }
  return result;
}

template <int N>
dual<N> chain(double value, double a, const dual<N>& x) {
  dual<N> result(value);
  for (int i = 0; i < N; ++i) {
    result.slope[i] = a * x.slope[i];
  }
  return result;
}

template <int N>
dual<N> operator+(const dual<N>& x, const dual<N>& y) {
  return combine(x.value + y.value, 1.0, x, 1.0, y);
}
template <int N>
dual<N> operator-(const dual<N>& x, const dual<N>& y) {
  return combine(x.value - y.value, 1.0, x, -1.0, y);
}
template <int N>
dual<N> operator*(const dual<N>& x, const dual<N>& y) {
  return combine(x.value * y.value, y.value, x, x.value, y);
}
template <int N>
dual<N> operator*(double a, const dual<N>& x) {
  return chain(a * x.value, a, x);
}
template <int N>
dual<N> operator/(const dual<N>& x, const dual<N>& y) {
  const double quotient = x.value / y.value;
  return combine(quotient, 1.0 / y.value, x, -quotient / y.value, y);
}
template <int N>
dual<N> operator-(const dual<N>& x) {
  return chain(-x.value, -1.0, x);
}

inline double value_of(double x) {
  return x;
}
template <int N>
double value_of(const dual<N>& x) {
  return x.value;
}

inline double square_root(double x) {
  return std::sqrt(x);
}
template <int N>
dual<N> square_root(const dual<N>& x) {
  const double root = std::sqrt(x.value);
  return chain(root, 0.5 / root, x);
}

template <int N>
struct dual_sine_and_cosine {
  dual<N> sine, cosine;
};

template <int N>
dual_sine_and_cosine<N> sine_cosine(const dual<N>& x) {
  const sine_and_cosine both = sine_cosine(x.value);
  return {chain(both.sine, both.cosine, x), chain(both.cosine, -both.sine, x)};
}

}  // namespace tendonfmu::plant
