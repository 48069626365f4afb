#include "bytes.h"

#include <string.h>

uint32_t load_u32(const unsigned char* from) {
  return (uint32_t)from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 | (uint32_t)from[3] << 24;
}

uint64_t load_u64(const unsigned char* from) {
  return (uint64_t)load_u32(from) | (uint64_t)load_u32(from + 4) << 32;
}

double load_f64(const unsigned char* from) {
  const uint64_t bits = load_u64(from);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

void store_u32(unsigned char* to, uint32_t value) {
  for (int i = 0; i < 4; ++i) {
    to[i] = (unsigned char)(value >> (8 * i));
  }
}

void store_u64(unsigned char* to, uint64_t value) {
  store_u32(to, (uint32_t)value);
  store_u32(to + 4, (uint32_t)(value >> 32));
}

void store_f64(unsigned char* to, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  store_u64(to, bits);
}

void load_doubles(double* to, const unsigned char* from, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    to[i] = load_f64(from + 8 * i);
  }
}

void store_doubles(unsigned char* to, const double* from, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    store_f64(to + 8 * i, from[i]);
  }
}

uint64_t hash_bytes(const void* bytes, size_t size, uint64_t seed) {
  const unsigned char* from = bytes;
  uint64_t hash = seed ^ 0xcbf29ce484222325u ^ (uint64_t)size;
  size_t i = 0;
  for (; i + 8 <= size; i += 8) {
    hash = (hash ^ load_u64(from + i)) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  }
  for (; i < size; ++i) {
    hash = (hash ^ from[i]) * 0x100000001b3u;
  }
  hash ^= hash >> 32;
  hash *= 0xd6e8feb86659fd93u;
  return hash ^ hash >> 32;
}
