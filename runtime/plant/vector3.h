/* Numbers with their derivatives along N directions, and vectors and matrices of three dimensions over them or over
 * plain numbers. Duals are used where a formula is long and rarely differentiated, the rigid bodies; everything else is
 * differentiated by hand. */
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
sine_and_cosine<dual<N>> sine_cosine(const dual<N>& x) {
  const sine_and_cosine<double> both = sine_cosine(x.value);
  return {chain(both.sine, both.cosine, x), chain(both.cosine, -both.sine, x)};
}

/* --- vectors and rotations --------------------------------------------------------------------------------------- */

template <class T>
struct vector3 {
  T x{}, y{}, z{};
};

template <class T>
vector3<T> operator+(const vector3<T>& a, const vector3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
vector3<T> operator-(const vector3<T>& a, const vector3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
vector3<T> operator*(const T& s, const vector3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
T dot(const vector3<T>& a, const vector3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
vector3<T> cross(const vector3<T>& a, const vector3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
vector3<T> constant(const std::array<double, 3>& a) {
  return {T(a[0]), T(a[1]), T(a[2])};
}

/* Columns of a rotation: the axes of a link in the base frame. */
template <class T>
struct rotation {
  vector3<T> column[3];

  vector3<T> operator*(const vector3<T>& a) const { return a.x * column[0] + a.y * column[1] + a.z * column[2]; }
  vector3<T> back(const vector3<T>& a) const { return {dot(column[0], a), dot(column[1], a), dot(column[2], a)}; }
};

/* `frame` turned by `angle` about `axis`, a unit vector in that frame (Rodrigues). */
template <class T>
rotation<T> turned(const rotation<T>& frame, const std::array<double, 3>& axis, const T& angle) {
  const auto both = sine_cosine(angle);
  const T s = both.sine, c = both.cosine, one_minus_c = T(1.0) - c;
  const auto [x, y, z] = axis;
  const vector3<T> first = {c + (x * x) * one_minus_c, (x * y) * one_minus_c + z * s, (x * z) * one_minus_c - y * s};
  const vector3<T> second = {(x * y) * one_minus_c - z * s, c + (y * y) * one_minus_c, (y * z) * one_minus_c + x * s};
  const vector3<T> third = {(x * z) * one_minus_c + y * s, (y * z) * one_minus_c - x * s, c + (z * z) * one_minus_c};
  return {{frame * first, frame * second, frame * third}};
}

}  // namespace tendonfmu::plant
