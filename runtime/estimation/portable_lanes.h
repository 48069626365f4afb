/* Two numbers at once, for the products of symmetric_update_kernel.h on any processor. */
#pragma once

#include <cstddef>
#include <cstring>

namespace tendonfmu::estimation {
namespace {

constexpr std::size_t lanes = 2, tile_vectors = 2, tile_columns = 4;

#if defined(__GNUC__)
using lane_vector = double __attribute__((vector_size(16)));

lane_vector load(const double* from) {
  lane_vector v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
void store(double* to, lane_vector v) {
  std::memcpy(to, &v, sizeof v);
}
lane_vector spread(double x) {
  return lane_vector{x, x};
}
lane_vector multiply_add(lane_vector a, lane_vector b, lane_vector c) {
  return a * b + c;
}
#else
struct lane_vector {
  double low, high;
};

lane_vector load(const double* from) {
  return {from[0], from[1]};
}
void store(double* to, lane_vector v) {
  to[0] = v.low;
  to[1] = v.high;
}
lane_vector spread(double x) {
  return {x, x};
}
lane_vector multiply_add(lane_vector a, lane_vector b, lane_vector c) {
  return {a.low * b.low + c.low, a.high * b.high + c.high};
}
#endif

}  // namespace
}  // namespace tendonfmu::estimation
