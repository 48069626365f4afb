/* Vectors and matrices of three dimensions over numbers or duals. */
#pragma once

#include <array>

#include "dual.h"

namespace tendonfmu::plant {

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
