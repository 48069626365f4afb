/* The kernels, and which of them may run here. */
#pragma once

#include "finger_memory.h"

/* What sensor_fault finds of all tendons, a bit each. */
typedef struct sensor_findings {
  uint64_t jumps;             /* of f0 */
  uint64_t forces, positions; /* stand, and contradict the spring */
  uint64_t stands;            /* f0, whether it does or not */
  uint64_t recovers;
} sensor_findings;

/* What of a sample is computed on lanes side by side. */
struct step_kernel {
  const char* name;
  /* 1 − exp(−x) of x >= 0 [count], a multiple of 4; both aligned to 32 bytes */
  void (*one_minus_exponentials)(const double* x, double* values, size_t count);
  /* product [N] of a matrix [n × M] and x [M] */
  void (*multiply)(const tendonfmu_finger* finger, const double* matrix, const double* x, double* product);
  /* eq. (5), from the joint velocities in the last row of velocity [n × M + N] */
  void (*tendon_velocities)(const tendonfmu_finger* finger, double* velocity);
  /* What sensor_fault remembers of all tendons, into scratch, where the faults up to now stand; angle [n] rad: as all
   * tendons or the sensors have it */
  sensor_findings (*watch_tendons)(const tendonfmu_finger* finger, const double* angle, double time, double step);
  /* The bands of a joint take a sample; any: some joint was in contact at the one before. */
  void (*follow_bands)(band_memory* joint, const band_sample* sample, const band_shares* shares, double young,
                       double age, int any);
  /* The largest share of its bound that what counts of a band's change has, both squared, and of which band.
   *   squares    [BAND_NUMBERS × BANDS] of the numbers of contact.bands
   *   terms      [BAND_TERMS × BANDS] receives what each is multiplied by */
  double (*weigh_bands)(const band_memory* joint, const double* squares, double* terms, size_t* band);
  /* F of every slot, forces, and T of eq. (10), in scratch; returns whether any slot comes to rest or begins to move */
  int (*find_friction)(tendonfmu_finger* finger);
  /* Fig. 5 for every slot, after its transitions: the side of what moves, the time of what rests */
  void (*remember_slots)(tendonfmu_finger* finger, double time);
};

extern const step_kernel step_plain;
extern const step_kernel step_vector; /* this and the next where compiler and processor have vectors */
extern const step_kernel step_avx2;

/* The fastest kernel that processor and operating system allow ("auto"), or the one of that name; NULL where it cannot
 * run or is not built in. */
const step_kernel* kernel_choose(const char* name);

/* Whether the compiler has kept the order of sums and the rounding of products. */
int kernel_rounds_as_written(void);
