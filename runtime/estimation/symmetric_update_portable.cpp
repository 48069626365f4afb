/* The products on what every processor of an architecture has: two numbers at once. */
#include "symmetric_update.h"

#include <cstring>

namespace tendonfmu::estimation {
namespace {

constexpr std::size_t LANES = 2, VECTORS = 2, COLUMNS = 4;

#if defined(__GNUC__)
using Vector = double __attribute__((vector_size(16)));

Vector load(const double* from) {
  Vector v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
void store(double* to, Vector v) {
  std::memcpy(to, &v, sizeof v);
}
Vector spread(double x) {
  return Vector{x, x};
}
Vector multiply_add(Vector a, Vector b, Vector c) {
  return a * b + c;
}
#else
struct Vector {
  double low, high;
};

Vector load(const double* from) {
  return {from[0], from[1]};
}
void store(double* to, Vector v) {
  to[0] = v.low;
  to[1] = v.high;
}
Vector spread(double x) {
  return {x, x};
}
Vector multiply_add(Vector a, Vector b, Vector c) {
  return {a.low * b.low + c.low, a.high * b.high + c.high};
}
#endif

}  // namespace
}  // namespace tendonfmu::estimation

#include "symmetric_update_kernel.h"

namespace tendonfmu::estimation {

const SymmetricUpdate portable_symmetric_update = {"portable", add_products, multiply_rows, mix_rows, multiply_by_rows};

}  // namespace tendonfmu::estimation
