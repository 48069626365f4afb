/* The library of an FMU, loaded as an importer loads it, for rows of python -m evidence.reliability.
 *
 *   fmu_calls day LIBRARY GUID LOCATION TABLE SAMPLES PIECES    two instances side by side, one of them saved, freed,
 *                                                               made anew and restored at each of PIECES
 *   fmu_calls threads LIBRARY GUID LOCATION TABLE SAMPLES COUNT as many instances, one on each thread
 *   fmu_calls quiet LIBRARY GUID LOCATION TABLE SAMPLES         allocations and system calls of set, step and get
 *   fmu_calls save LIBRARY GUID LOCATION TABLE SAMPLES FILE     a saved state
 *   fmu_calls states LIBRARY GUID LOCATION TABLE SAMPLES FLIPS FILE...  states that are no state of this FMU
 *   fmu_calls hungry LIBRARY GUID LOCATION TABLE SAMPLES        each allocation fails once
 *
 * TABLE is a file: the numbers of tendons and joints, the value references of the inputs in the order of motion.h, the
 * number of Real outputs, theirs. */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <linux/seccomp.h>

#include "bytes.h"
#include "fmi2FunctionTypes.h"
#include "motion.h"

enum { MOST = 80, MOST_OUTPUTS = 4096 };

static void fail(const char* what, const char* why) {
  fprintf(stderr, "fmu_calls: %s: %s\n", what, why);
  exit(1);
}

/* --- allocations: counted, and failing when wanted ------------------------------------------------------------------
 */

#if !defined(__SANITIZE_THREAD__)
static long allocations, failing_at = -1; /* of one thread */

void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* block, size_t size);

static int is_to_fail(void) {
  return allocations++ == failing_at;
}
void* malloc(size_t size) {
  return is_to_fail() ? NULL : __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  return is_to_fail() ? NULL : __libc_calloc(count, size);
}
void* realloc(void* block, size_t size) {
  return is_to_fail() ? NULL : __libc_realloc(block, size);
}
#endif

/* --- the library ----------------------------------------------------------------------------------------------------
 */

static struct {
  const char *guid, *location;
  size_t tendons, joints, inputs, outputs;
  fmi2ValueReference input[2 * MOST + 2 * MOST], output[MOST_OUTPUTS];
  fmi2InstantiateTYPE* instantiate;
  fmi2FreeInstanceTYPE* free_instance;
  fmi2SetupExperimentTYPE* set_up;
  fmi2EnterInitializationModeTYPE* enter;
  fmi2ExitInitializationModeTYPE* leave;
  fmi2SetRealTYPE* set;
  fmi2GetRealTYPE* get;
  fmi2DoStepTYPE* step;
  fmi2GetFMUstateTYPE* get_state;
  fmi2SetFMUstateTYPE* set_state;
  fmi2FreeFMUstateTYPE* free_state;
  fmi2SerializedFMUstateSizeTYPE* size_of_state;
  fmi2SerializeFMUstateTYPE* serialize;
  fmi2DeSerializeFMUstateTYPE* deserialize;
  fmi2GetDirectionalDerivativeTYPE* derive;
} fmu;

static void load(const char* library) {
  void* handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  if (!handle) {
    fail(library, dlerror());
  }
#define TAKE(member, name) *(void**)&fmu.member = dlsym(handle, "fmi2" name)
  TAKE(instantiate, "Instantiate");
  TAKE(free_instance, "FreeInstance");
  TAKE(set_up, "SetupExperiment");
  TAKE(enter, "EnterInitializationMode");
  TAKE(leave, "ExitInitializationMode");
  TAKE(set, "SetReal");
  TAKE(get, "GetReal");
  TAKE(step, "DoStep");
  TAKE(get_state, "GetFMUstate");
  TAKE(set_state, "SetFMUstate");
  TAKE(free_state, "FreeFMUstate");
  TAKE(size_of_state, "SerializedFMUstateSize");
  TAKE(serialize, "SerializeFMUstate");
  TAKE(deserialize, "DeSerializeFMUstate");
  TAKE(derive, "GetDirectionalDerivative");
#undef TAKE
}

static void read_table(const char* path) {
  FILE* file = fopen(path, "r");
  int sound =
      file && fscanf(file, "%zu %zu", &fmu.tendons, &fmu.joints) == 2 && fmu.tendons <= MOST && fmu.joints <= MOST;
  fmu.inputs = 2 * fmu.tendons + 2 * fmu.joints;
  for (size_t i = 0; sound && i < fmu.inputs; ++i) {
    sound = fscanf(file, "%u", &fmu.input[i]) == 1;
  }
  sound = sound && fscanf(file, "%zu", &fmu.outputs) == 1 && fmu.outputs <= MOST_OUTPUTS;
  for (size_t i = 0; sound && i < fmu.outputs; ++i) {
    sound = fscanf(file, "%u", &fmu.output[i]) == 1;
  }
  if (!sound) {
    fail(path, "not a table of references");
  }
  fclose(file);
}

static void must(fmi2Status status, const char* what) {
  if (status != fmi2OK) {
    fail(what, "not OK");
  }
}

static fmi2Component instance(void) {
  return fmu.instantiate("reliable", fmi2CoSimulation, fmu.guid, fmu.location, NULL, fmi2False, fmi2False);
}

static fmi2Status set_inputs(fmi2Component c, long sample, unsigned seed) {
  double values[4 * MOST];
  double* position = values + fmu.tendons;
  motion_inputs(sample, seed, fmu.tendons, fmu.joints, values, position, position + fmu.tendons,
                position + fmu.tendons + fmu.joints);
  return fmu.set(c, fmu.input, fmu.inputs, values);
}

static fmi2Component started(unsigned seed) {
  fmi2Component c = instance();
  if (!c) {
    fail("fmi2Instantiate", "no instance");
  }
  must(fmu.set_up(c, 0, 0.0, 0.0, 0, 0.0), "fmi2SetupExperiment");
  must(fmu.enter(c), "fmi2EnterInitializationMode");
  must(set_inputs(c, 0, seed), "fmi2SetReal");
  must(fmu.leave(c), "fmi2ExitInitializationMode");
  return c;
}

/* the sample's outputs, in `outputs` [fmu.outputs] */
static void take(fmi2Component c, long sample, unsigned seed, double* outputs) {
  must(set_inputs(c, sample, seed), "fmi2SetReal");
  must(fmu.step(c, motion_time(sample), 0.001, fmi2True), "fmi2DoStep");
  must(fmu.get(c, fmu.output, fmu.outputs, outputs), "fmi2GetReal");
}

static char* saved(fmi2Component c, size_t* size) {
  fmi2FMUstate state = NULL;
  must(fmu.get_state(c, &state), "fmi2GetFMUstate");
  must(fmu.size_of_state(c, state, size), "fmi2SerializedFMUstateSize");
  char* bytes = malloc(*size);
  must(fmu.serialize(c, state, bytes, *size), "fmi2SerializeFMUstate");
  must(fmu.free_state(c, &state), "fmi2FreeFMUstate");
  return bytes;
}

static void restore(fmi2Component c, const char* bytes, size_t size) {
  fmi2FMUstate state = NULL;
  must(fmu.deserialize(c, bytes, size, &state), "fmi2DeSerializeFMUstate");
  must(fmu.set_state(c, state), "fmi2SetFMUstate");
  must(fmu.free_state(c, &state), "fmi2FreeFMUstate");
}

/* --- a day ----------------------------------------------------------------------------------------------------------
 */

static void day(long samples, long pieces) {
  static double whole_row[MOST_OUTPUTS], piece_row[MOST_OUTPUTS];
  static double early[MOTION_PERIOD][16];
  const size_t compared = fmu.outputs < 16 ? fmu.outputs : 16; /* the first ones: compensated torques and more */
  long different = 0;
  double drift = 0.0, largest = 0.0;
  size_t heap_early = 0, heap_late = 0;
  long resident_early = 0;
  struct rusage usage;
  fmi2Component whole = started(0), piece = started(0);
  for (long k = 1; k < samples; ++k) {
    if (k % (samples / pieces) == 0) {
      size_t size = 0;
      char* bytes = saved(piece, &size);
      fmu.free_instance(piece);
      piece = instance();
      restore(piece, bytes, size);
      free(bytes);
    }
    take(whole, k, 0, whole_row);
    take(piece, k, 0, piece_row);
    different += memcmp(whole_row, piece_row, fmu.outputs * sizeof *whole_row) != 0;
    const long period = k / MOTION_PERIOD, last = samples / MOTION_PERIOD - 1;
    if (period == last / 24 + 1) { /* after the first hour of a day */
      memcpy(early[k % MOTION_PERIOD], whole_row, compared * sizeof *whole_row);
    }
    if (period == last) {
      for (size_t i = 0; i < compared; ++i) {
        drift = fmax(drift, fabs(whole_row[i] - early[k % MOTION_PERIOD][i]));
        largest = fmax(largest, fabs(whole_row[i]));
      }
    }
    if (k == samples / 2 || k == samples - 1) {
      const size_t heap = mallinfo2().uordblks;
      getrusage(RUSAGE_SELF, &usage);
      if (k == samples - 1) {
        heap_late = heap;
      } else {
        heap_early = heap;
        resident_early = usage.ru_maxrss;
      }
    }
  }
  printf("%ld %.3g %.3g %ld %ld\n", different, drift, largest, (long)heap_late - (long)heap_early,
         usage.ru_maxrss - resident_early);
  fmu.free_instance(whole);
  fmu.free_instance(piece);
}

/* --- threads --------------------------------------------------------------------------------------------------------
 */

typedef struct player {
  pthread_t thread;
  unsigned seed;
  long samples;
  uint64_t hash;
} player;

static void* play(void* argument) {
  player* p = argument;
  double row[MOST_OUTPUTS];
  p->hash = 0xcbf29ce484222325u;
  fmi2Component c = started(p->seed);
  for (long k = 1; k < p->samples; ++k) {
    take(c, k, p->seed, row);
    p->hash = motion_hash(p->hash, row, fmu.outputs * sizeof *row);
    if (k % 500 == 250) { /* a new instance takes over */
      size_t size = 0;
      char* bytes = saved(c, &size);
      fmu.free_instance(c);
      c = instance();
      restore(c, bytes, size);
      free(bytes);
    }
  }
  fmu.free_instance(c);
  return NULL;
}

static void threads(long samples, long count) {
  player* alone = calloc((size_t)count, sizeof *alone);
  player* together = calloc((size_t)count, sizeof *together);
  int different = 0;
  for (long i = 0; i < count; ++i) {
    alone[i] = together[i] = (player){.seed = (unsigned)i, .samples = samples};
    play(&alone[i]);
  }
  for (long i = 0; i < count; ++i) {
    if (pthread_create(&together[i].thread, NULL, play, &together[i])) {
      fail("pthread_create", "no thread");
    }
  }
  for (long i = 0; i < count; ++i) {
    pthread_join(together[i].thread, NULL);
    different += together[i].hash != alone[i].hash;
  }
  printf("%d\n", different);
}

#if !defined(__SANITIZE_THREAD__)

/* --- quiet ----------------------------------------------------------------------------------------------------------
 */

static int steps_alone(fmi2Component c, long samples) {
  static double row[MOST_OUTPUTS];
  const double one = 1.0;
  int wrong = 0;
  for (long k = 1; k < samples; ++k) {
    wrong += set_inputs(c, k, 0) != fmi2OK;
    wrong += fmu.step(c, motion_time(k), 0.001, fmi2True) != fmi2OK;
    wrong += fmu.get(c, fmu.output, fmu.outputs, row) != fmi2OK;
    if (k % 100 == 0) {
      wrong += fmu.derive(c, fmu.output, 1, fmu.input, 1, &one, row) != fmi2OK;
    }
  }
  return wrong;
}

/* exit status of a child that the kernel kills at its first system call other than exit */
static int strictly(int (*action)(fmi2Component, long), fmi2Component c, long samples) {
  const pid_t child = fork();
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
      _exit(77);
    }
    const int wrong = action(c, samples);
    syscall(SYS_exit, wrong ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

static int calls_the_system(fmi2Component c, long samples) {
  (void)c, (void)samples;
  return getppid() == 0;
}

static void quiet(long samples) {
  fmi2Component c = started(0);
  const int noticed = strictly(calls_the_system, c, samples), status = strictly(steps_alone, c, samples);
  const long before = allocations;
  const int wrong = steps_alone(c, samples);
  const long counted = allocations - before;
  fmu.free_instance(c);
  printf("%ld %d %d %d\n", counted, wrong, status, noticed);
}

#include "fmu_saved_states.h"
#endif

int main(int count, char** words) {
  if (count < 7) {
    fail("usage", "see the top of fmu_calls.c");
  }
  const char* what = words[1];
  const long samples = atol(words[6]), number = count > 7 ? atol(words[7]) : 0;
  load(words[2]);
  fmu.guid = words[3];
  fmu.location = words[4];
  read_table(words[5]);
  if (!strcmp(what, "day")) {
    day(samples, number);
  } else if (!strcmp(what, "threads")) {
    threads(samples, number);
#if !defined(__SANITIZE_THREAD__)
  } else if (!strcmp(what, "quiet")) {
    quiet(samples);
  } else if (!strcmp(what, "hungry")) {
    hungry();
  } else if (!strcmp(what, "states")) {
    states(samples, number, count - 8, words + 8);
  } else if (!strcmp(what, "save") && count == 8) {
    save(samples, words[7]);
#endif
  } else {
    fail("usage", "see the top of fmu_calls.c");
  }
  return 0;
}
