/* Little-endian numbers at any alignment, and a hash that is the same on every machine. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

uint32_t load_u32(const unsigned char* from);
uint64_t load_u64(const unsigned char* from);
double load_f64(const unsigned char* from);
void store_u32(unsigned char* to, uint32_t value);
void store_u64(unsigned char* to, uint64_t value);
void store_f64(unsigned char* to, double value);

/* Whole runs of doubles; one copy on a little-endian host. */
void load_doubles(double* to, const unsigned char* from, size_t count);
void store_doubles(unsigned char* to, const double* from, size_t count);

/* 64-bit hash of bytes: finds damage, is no protection against intent. */
uint64_t hash_bytes(const void* bytes, size_t size, uint64_t seed);

#ifdef __cplusplus
}
#endif
