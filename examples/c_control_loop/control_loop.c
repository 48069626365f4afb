/* A 1 kHz control loop that feels contact through the tendons.
 *
 *   control_loop FINGER.json SECONDS
 *
 * Start-up reads the description and may allocate; the loop itself neither allocates, locks nor calls the system,
 * except to wait for the next tick. */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <tendonfmu_description.h>
#include <time.h>

#include "sensors.h"

enum { PERIOD_NS = 1000000 };

static double seconds_between(struct timespec a, struct timespec b) {
  return (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec);
}

static char* read_file(const char* path, size_t* size) {
  FILE* file = fopen(path, "rb");
  char* text = NULL;
  if (file && fseek(file, 0, SEEK_END) == 0 && ftell(file) > 0) {
    *size = (size_t)ftell(file);
    rewind(file);
    text = malloc(*size);
    if (text && fread(text, 1, *size, file) != *size) {
      free(text);
      text = NULL;
    }
  }
  if (file) {
    fclose(file);
  }
  return text;
}

/* description -> image -> finger; on a microcontroller the image is a constant array, and tendonfmu_place() takes it */
static tendonfmu_finger* load_finger(const char* path) {
  char message[400] = "cannot read it";
  void* image = NULL;
  size_t image_size = 0, size = 0;
  tendonfmu_finger* finger = NULL;
  char* json = read_file(path, &size);
  if (json && tendonfmu_image_from_json(json, size, &image, &image_size, message, sizeof message) == TENDONFMU_OK) {
    finger = tendonfmu_create(image, image_size, message, sizeof message);
  }
  if (!finger) {
    fprintf(stderr, "control_loop: %s: %s\n", path, message);
  }
  tendonfmu_free_image(image);
  free(json);
  return finger;
}

/* sleeps until `tick` and moves it on by a period */
static void wait_for(struct timespec* tick) {
  struct timespec now, rest;
  clock_gettime(CLOCK_MONOTONIC, &now);
  const double ahead = seconds_between(now, *tick);
  if (ahead > 0.0) {
    rest.tv_sec = (time_t)ahead;
    rest.tv_nsec = (long)(1e9 * (ahead - (double)rest.tv_sec));
    nanosleep(&rest, NULL);
  }
  tick->tv_nsec += PERIOD_NS;
  if (tick->tv_nsec >= 1000000000) {
    tick->tv_nsec -= 1000000000;
    tick->tv_sec += 1;
  }
}

/* index from 0 of the largest magnitude */
static size_t most_loaded(const double* torque, size_t joints) {
  size_t most = 0;
  for (size_t j = 1; j < joints; ++j) {
    most = fabs(torque[j]) > fabs(torque[most]) ? j : most;
  }
  return most;
}

/* the loop; returns how many times contact began, or −1 */
static int control(tendonfmu_finger* finger, const sensors* hand, double seconds, double* worst_step) {
  double force[64], position[64], torque[16];
  unsigned char contact = 0, before = 0;
  int touches = 0;
  const tendonfmu_inputs inputs = {force, position, NULL, NULL};
  tendonfmu_outputs outputs = {0};
  outputs.compensated_torque = torque;
  outputs.contact = &contact;

  struct timespec start, tick, begin, end;
  clock_gettime(CLOCK_MONOTONIC, &start);
  tick = start;
  for (double time = 0.0; time < seconds;) {
    sensors_read(hand, time, force, position);

    clock_gettime(CLOCK_MONOTONIC, &begin);
    const tendonfmu_status status = tendonfmu_is_initialised(finger) ? tendonfmu_step(finger, time, &inputs)
                                                                     : tendonfmu_initialise(finger, time, &inputs);
    clock_gettime(CLOCK_MONOTONIC, &end);
    if (status != TENDONFMU_OK) {
      fprintf(stderr, "control_loop: %s\n", tendonfmu_last_error(finger));
      return -1;
    }
    *worst_step = seconds_between(begin, end) > *worst_step ? seconds_between(begin, end) : *worst_step;

    /* here your controller would use torque[] and contact */
    tendonfmu_get_outputs(finger, &outputs);
    if (contact && !before) {
      const size_t j = most_loaded(torque, tendonfmu_joint_count(finger));
      printf("%8.3f s  contact, compensated torque of joint %zu: %+.4f N.m\n", time, j + 1, torque[j]);
      ++touches;
    } else if (before && !contact) {
      printf("%8.3f s  free again\n", time);
    }
    before = contact;
    wait_for(&tick);
    clock_gettime(CLOCK_MONOTONIC, &end);
    time = seconds_between(start, end); /* the time of the sample is the time at which it is read */
  }
  return touches;
}

int main(int count, char** arguments) {
  if (count != 3 || atof(arguments[2]) <= 0.0) {
    fprintf(stderr, "usage: control_loop FINGER.json SECONDS\n");
    return 2;
  }
  tendonfmu_finger* finger = load_finger(arguments[1]);
  static sensors hand;
  if (!finger || sensors_begin(&hand, finger)) {
    tendonfmu_destroy(finger);
    return 2;
  }
  double worst_step = 0.0;
  const int touches = control(finger, &hand, atof(arguments[2]), &worst_step);
  printf("%zu joints, %zu tendons, kernel %s: %d contacts, longest step %.1f us\n", tendonfmu_joint_count(finger),
         tendonfmu_tendon_count(finger), tendonfmu_get_kernel(finger), touches, 1e6 * worst_step);
  tendonfmu_destroy(finger);
  return touches < 0 ? 1 : 0;
}
