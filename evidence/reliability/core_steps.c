/* Steps of a finger through tendonfmu.h, for rows of python -m evidence.reliability.
 *
 *   core_steps trace IMAGE SAMPLES                       a line for each kernel: its name, a hash of all outputs and of
 *                                                        the saved state at the end
 *   core_steps save IMAGE SAMPLES KERNEL FILE            the state after so many samples
 *   core_steps continue IMAGE FILE FROM SAMPLES KERNEL   goes on from it: the hash of the outputs and of the state;
 *                                                        FILE "-": without a stop in between
 *   core_steps times IMAGE SAMPLES                       times of steps */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "motion.h"
#include "tendonfmu.h"

enum { MOST_JOINTS = 16, MOST_TENDONS = 64 };

static const char* const kernels[] = {"plain", "sse2", "avx2", "avx512"};

static void fail(const char* what, const char* why) {
  fprintf(stderr, "core_steps: %s: %s\n", what, why);
  exit(1);
}

static unsigned char* read_file(const char* path, size_t* size) {
  FILE* file = fopen(path, "rb");
  if (!file || fseek(file, 0, SEEK_END)) {
    fail(path, "cannot be read");
  }
  *size = (size_t)ftell(file);
  rewind(file);
  unsigned char* bytes = malloc(*size);
  if (!bytes || fread(bytes, 1, *size, file) != *size) {
    fail(path, "cannot be read");
  }
  fclose(file);
  return bytes;
}

static tendonfmu_finger* create(const char* path) {
  size_t size = 0;
  char message[400] = "";
  unsigned char* image = read_file(path, &size);
  tendonfmu_finger* finger = tendonfmu_create(image, size, message, sizeof message);
  if (!finger) {
    fail(path, message);
  }
  free(image);
  return finger;
}

static tendonfmu_finger* create_on(const char* path, const char* kernel) {
  tendonfmu_finger* finger = create(path);
  if (tendonfmu_set_kernel(finger, kernel) != TENDONFMU_OK) {
    fail(kernel, tendonfmu_last_error(finger));
  }
  return finger;
}

/* the saved state, to be freed */
static unsigned char* state_of(tendonfmu_finger* finger, size_t* size) {
  *size = tendonfmu_state_size(finger);
  unsigned char* bytes = malloc(*size);
  if (!bytes || tendonfmu_save_state(finger, bytes, *size) != TENDONFMU_OK) {
    fail("saved state", tendonfmu_last_error(finger));
  }
  return bytes;
}

static int step(tendonfmu_finger* finger, long sample) {
  double force[MOST_TENDONS], position[MOST_TENDONS], angle[MOST_JOINTS], velocity[MOST_JOINTS];
  const tendonfmu_inputs inputs = {force, position, angle, velocity};
  motion_inputs(sample, 0, tendonfmu_tendon_count(finger), tendonfmu_joint_count(finger), force, position, angle,
                velocity);
  return sample == 0 ? tendonfmu_initialise(finger, 0.0, &inputs)
                     : tendonfmu_step(finger, motion_time(sample), &inputs);
}

/* Takes samples first..last-1; the hash of all their Real outputs, then of the state at the end. */
static uint64_t play(tendonfmu_finger* finger, long first, long last) {
  const size_t joints = tendonfmu_joint_count(finger), tendons = tendonfmu_tendon_count(finger);
  static double parts[MOST_JOINTS * (MOST_TENDONS + 3)], rows[12][MOST_JOINTS];
  const tendonfmu_outputs outputs = {.compensated_torque = rows[0],
                                     .joint_torque = rows[1],
                                     .friction_torque = rows[2],
                                     .bias_torque = rows[3],
                                     .joint_angle = rows[4],
                                     .joint_speed = rows[5],
                                     .compensated_torque_std = rows[6],
                                     .residual = rows[7],
                                     .innovation = rows[8],
                                     .stuck_friction = rows[9],
                                     .friction_jump = rows[10],
                                     .drift = rows[11],
                                     .friction_parts = parts};
  uint64_t hash = 0xcbf29ce484222325u;
  for (long k = first; k < last; ++k) {
    if (step(finger, k) != TENDONFMU_OK || tendonfmu_get_outputs(finger, &outputs) != TENDONFMU_OK) {
      fail("step", tendonfmu_last_error(finger));
    }
    hash = motion_hash(hash, rows, sizeof rows);
    hash = motion_hash(hash, parts, joints * (tendons + 3) * sizeof *parts);
  }
  size_t size = 0;
  unsigned char* bytes = state_of(finger, &size);
  hash = motion_hash(hash, bytes, size);
  free(bytes);
  return hash;
}

static void trace(const char* image, long samples) {
  for (size_t k = 0; k < sizeof kernels / sizeof *kernels; ++k) {
    tendonfmu_finger* finger = create(image);
    if (tendonfmu_set_kernel(finger, kernels[k]) == TENDONFMU_OK) {
      printf("%s %016llx\n", kernels[k], (unsigned long long)play(finger, 0, samples));
    }
    tendonfmu_destroy(finger);
  }
}

static void save(const char* image, long samples, const char* kernel, const char* path) {
  tendonfmu_finger* finger = create_on(image, kernel);
  play(finger, 0, samples);
  size_t size = 0;
  unsigned char* bytes = state_of(finger, &size);
  FILE* file = fopen(path, "wb");
  if (!file || fwrite(bytes, 1, size, file) != size || fclose(file)) {
    fail(path, "cannot be written");
  }
  free(bytes);
  tendonfmu_destroy(finger);
}

static void go_on(const char* image, const char* path, long first, long last, const char* kernel) {
  tendonfmu_finger* finger = create_on(image, kernel);
  if (!strcmp(path, "-")) {
    play(finger, 0, first);
  } else {
    size_t size = 0;
    unsigned char* bytes = read_file(path, &size);
    if (tendonfmu_restore_state(finger, bytes, size) != TENDONFMU_OK) {
      fail(path, tendonfmu_last_error(finger));
    }
    free(bytes);
  }
  printf("%016llx\n", (unsigned long long)play(finger, first, last));
  tendonfmu_destroy(finger);
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int ascending(const void* a, const void* b) {
  const double x = *(const double*)a, y = *(const double*)b;
  return (x > y) - (x < y);
}

/* Each place of the motion's period is stepped samples/period times. Its shortest time is that of the code alone; the
 * longest of all is what other programs and the clock's own call add. Prints ns: the median and the largest of the
 * shortest, the largest of all, and how many of 1e6 took above 10 µs. */
static void times(const char* image, long samples) {
  static double best[MOTION_PERIOD], force[MOTION_PERIOD][MOST_TENDONS], position[MOTION_PERIOD][MOST_TENDONS];
  static double angle[MOTION_PERIOD][MOST_JOINTS], velocity[MOTION_PERIOD][MOST_JOINTS];
  double longest = 0.0;
  long slow = 0;
  tendonfmu_finger* finger = create(image);
  const size_t tendons = tendonfmu_tendon_count(finger), joints = tendonfmu_joint_count(finger);
  for (size_t i = 0; i < MOTION_PERIOD; ++i) {
    best[i] = 1.0;
    motion_inputs((long)i, 0, tendons, joints, force[i], position[i], angle[i], velocity[i]);
  }
  for (long k = 0; k < samples; ++k) {
    const size_t at = (size_t)(k % MOTION_PERIOD);
    const tendonfmu_inputs inputs = {force[at], position[at], angle[at], velocity[at]};
    const double begin = now();
    const int status =
        k == 0 ? tendonfmu_initialise(finger, 0.0, &inputs) : tendonfmu_step(finger, motion_time(k), &inputs);
    const double took = now() - begin;
    if (status != TENDONFMU_OK) {
      fail("step", tendonfmu_last_error(finger));
    }
    if (k >= MOTION_PERIOD && took < best[at]) {
      best[at] = took;
    }
    longest = took > longest ? took : longest;
    slow += took > 1e-5;
  }
  qsort(best, MOTION_PERIOD, sizeof *best, ascending);
  printf("%s %.0f %.0f %.0f %.3f\n", tendonfmu_get_kernel(finger), 1e9 * best[MOTION_PERIOD / 2],
         1e9 * best[MOTION_PERIOD - 1], 1e9 * longest, 1e6 * (double)slow / (double)samples);
  tendonfmu_destroy(finger);
}

int main(int count, char** words) {
  const char* what = count > 1 ? words[1] : "";
  if (!strcmp(what, "trace") && count == 4) {
    trace(words[2], atol(words[3]));
  } else if (!strcmp(what, "save") && count == 6) {
    save(words[2], atol(words[3]), words[4], words[5]);
  } else if (!strcmp(what, "continue") && count == 7) {
    go_on(words[2], words[3], atol(words[4]), atol(words[5]), words[6]);
  } else if (!strcmp(what, "times") && count == 4) {
    times(words[2], atol(words[3]));
  } else {
    fail("usage", "trace | save | continue | times, see the top of core_steps.c");
  }
  return 0;
}
