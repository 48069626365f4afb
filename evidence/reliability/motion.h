/* A motion that has the same bits everywhere: no libm, only + - * / and whole numbers. It repeats every 6 s at 1 kHz,
 * with reversals, rests and a push, so that what a finger gives hours apart can be compared. */
#ifndef RELIABILITY_MOTION_H
#define RELIABILITY_MOTION_H

#include <stddef.h>
#include <stdint.h>

enum { MOTION_PERIOD = 6000 }; /* samples */

/* from -1 to 1 and back, once in `period` samples, smooth at the ends */
static inline double motion_swing(long sample, long period) {
  const double x = (double)(sample % period) / (double)period;
  const double triangle = x < 0.25 ? 4.0 * x : x < 0.75 ? 2.0 - 4.0 * x : 4.0 * x - 4.0;
  return triangle * (1.5 - 0.5 * triangle * triangle);
}

static inline double motion_time(long sample) {
  return 0.001 * (double)sample;
}

/* forces [m] N, positions [m] m, angles [n] rad and velocities [n] rad/s at a sample; `seed` makes fingers differ */
static inline void motion_inputs(long sample, unsigned seed, size_t tendons, size_t joints, double* force,
                                 double* position, double* angle, double* velocity) {
  static const long periods[] = {6000, 3000, 2000, 1500, 1200, 1000};
  const long rest = sample % 1500 > 1200 ? sample - sample % 1500 + 1200 : sample;
  const int pushed = sample % MOTION_PERIOD > 5000 && sample % MOTION_PERIOD < 5300;
  for (size_t i = 0; i < tendons; ++i) {
    const long shift = 37 * (long)i + 11 * (long)seed;
    force[i] =
        15.0 + 0.5 * (double)i + 3.0 * motion_swing(sample + shift, periods[i % 6]) + (pushed && i == 0 ? 9.0 : 0.0);
    position[i] = (i % 2 ? -0.003 : 0.003) * motion_swing(rest + 5 * (long)i, periods[i % 3]);
  }
  for (size_t j = 0; j < joints; ++j) {
    angle[j] = 0.5 * motion_swing(rest, periods[j % 3]);
    velocity[j] =
        rest != sample
            ? 0.0
            : 500.0 *
                  (motion_swing(rest + 1, periods[j % 3]) - motion_swing(rest + MOTION_PERIOD - 1, periods[j % 3])) *
                  0.5;
  }
}

/* FNV-1a over the bits of numbers */
static inline uint64_t motion_hash(uint64_t hash, const void* numbers, size_t bytes) {
  const unsigned char* at = numbers;
  for (size_t i = 0; i < bytes; ++i) {
    hash = (hash ^ at[i]) * 0x100000001b3u;
  }
  return hash;
}

#endif
