/* Included by fmu_calls.c, once. */
/* --- saved states ---------------------------------------------------------------------------------------------------
 */

static uint64_t seed_of_all = 1;

static uint64_t random_number(uint64_t below) { /* xorshift64 */
  seed_of_all ^= seed_of_all << 13;
  seed_of_all ^= seed_of_all >> 7;
  seed_of_all ^= seed_of_all << 17;
  return seed_of_all % below;
}

/* the core's state inside that of the FMU, then the FMU's own */
static void repair(char* bytes, size_t size) {
  char* core = memmem(bytes + 40, size - 40, "TFMUSTA", 8);
  if (core) {
    store_u64((unsigned char*)core + 24, hash_bytes(core + 32, size - (size_t)(core - bytes) - 32, 0));
  }
  store_u64((unsigned char*)bytes + 24, motion_hash(0xcbf29ce484222325u, bytes + 32, size - 32));
}

/* but for the checksums, and the sign of zeros */
static int is_same_state(const char* a, const char* b, size_t size) {
  for (size_t i = 32; i + 8 <= size; i += 8) {
    double x, y;
    memcpy(&x, a + i, sizeof x);
    memcpy(&y, b + i, sizeof y);
    if (memcmp(a + i, b + i, 8) != 0 && !(x == 0.0 && y == 0.0)) {
      fprintf(stderr, "byte %zu of %zu: %g and %g\n", i, size, x, y);
      return 0;
    }
  }
  return 1;
}

/* 1 taken over, 0 refused and nothing changed; ends the program where neither holds */
static int offered(fmi2Component c, const char* good, size_t size, const char* bytes, size_t length) {
  fmi2FMUstate state = NULL;
  size_t now_size = 0;
  const fmi2Status status = fmu.deserialize(c, bytes, length, &state);
  const int taken = status == fmi2OK && fmu.set_state(c, state) == fmi2OK;
  char* now = saved(c, &now_size);
  if (now_size != size || (taken ? !is_same_state(now, bytes, size) : memcmp(now, good, size) != 0)) {
    fail("state", taken ? "taken over, but not as it was given" : "refused, but something has changed");
  }
  free(now);
  must(fmu.free_state(c, &state), "fmi2FreeFMUstate");
  return taken;
}

/* an instance with a state that nobody saved: finite outputs, or a step that is refused */
static void goes_on(fmi2Component c, long sample) {
  static double row[MOST_OUTPUTS];
  for (long k = sample; k < sample + 20; ++k) {
    if (set_inputs(c, k, 0) != fmi2OK || fmu.step(c, motion_time(k), 0.001, fmi2True) != fmi2OK) {
      return;
    }
    must(fmu.get(c, fmu.output, fmu.outputs, row), "fmi2GetReal");
    for (size_t i = 0; i < fmu.outputs; ++i) {
      if (!isfinite(row[i])) {
        fail("output after a damaged state", "not finite");
      }
    }
  }
}

/* Prints: lengths tried and taken; flips under the old checksum and taken; flips under one that fits and taken;
 * files of other states and taken. */
static void states(long samples, long flips, int files, char** file) {
  static double row[MOST_OUTPUTS];
  fmi2Component c = started(0);
  for (long k = 1; k < samples; ++k) {
    take(c, k, 0, row);
  }
  size_t size = 0;
  char* good = saved(c, &size);
  char* bytes = calloc(size + 64, 1);
  long taken[4] = {0}, tried[4] = {0};
  for (size_t length = 0; length <= size + 64; ++length, ++tried[0]) {
    memset(bytes, 0, size + 64);
    memcpy(bytes, good, length < size ? length : size);
    taken[0] += length == size ? 0 : offered(c, good, size, bytes, length);
    restore(c, good, size);
  }
  for (int repaired = 0; repaired < 2; ++repaired) {
    for (long k = 0; k < flips; ++k, ++tried[1 + repaired]) {
      const uint64_t bit = random_number(8 * size);
      memcpy(bytes, good, size);
      bytes[bit / 8] = (char)(bytes[bit / 8] ^ 1 << bit % 8);
      if (repaired) {
        repair(bytes, size);
      }
      if (offered(c, good, size, bytes, size)) {
        taken[1 + repaired] += 1;
        goes_on(c, samples);
      }
      restore(c, good, size);
    }
  }
  for (int k = 0; k < files; ++k, ++tried[3]) {
    FILE* from = fopen(file[k], "rb");
    char* other = calloc(1, 1 << 22);
    const size_t length = from ? fread(other, 1, 1 << 22, from) : 0;
    if (!length) {
      fail(file[k], "cannot be read");
    }
    fclose(from);
    taken[3] += offered(c, good, size, other, length);
    restore(c, good, size);
    free(other);
  }
  for (int k = 0; k < 4; ++k) {
    printf("%ld %ld\n", tried[k], taken[k]);
  }
  free(good);
  free(bytes);
  fmu.free_instance(c);
}

static void save(long samples, const char* path) {
  static double row[MOST_OUTPUTS];
  fmi2Component c = started(0);
  for (long k = 1; k < samples; ++k) {
    take(c, k, 0, row);
  }
  size_t size = 0;
  char* bytes = saved(c, &size);
  FILE* file = fopen(path, "wb");
  if (!file || fwrite(bytes, 1, size, file) != size || fclose(file)) {
    fail(path, "cannot be written");
  }
  free(bytes);
  fmu.free_instance(c);
}

/* --- no memory ------------------------------------------------------------------------------------------------------
 */

static long messages; /* that say memory, of the last trial */

static void log_line(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                     fmi2String message, ...) {
  (void)environment, (void)name, (void)category;
  messages += status == fmi2Error && strstr(message, "memory") != NULL;
}

static void* no_allocation(size_t count, size_t size) { /* the FMU takes its own: it says so in its description */
  (void)count, (void)size;
  return NULL;
}

/* life of an instance in which allocation number `failing` fails; 1 when some call was refused for it */
static int short_of_one(long failing, long* left) {
  const fmi2CallbackFunctions callbacks = {log_line, no_allocation, free, NULL, NULL};
  fmi2FMUstate state = NULL;
  int refused = 0;
  const size_t before = mallinfo2().uordblks;
  allocations = 0;
  failing_at = failing;
  fmi2Component c =
      fmu.instantiate("hungry", fmi2CoSimulation, fmu.guid, fmu.location, &callbacks, fmi2False, fmi2True);
  if (c) {
    must(fmu.enter(c), "fmi2EnterInitializationMode");
    must(fmu.leave(c), "fmi2ExitInitializationMode");
    must(fmu.step(c, 0.001, 0.001, fmi2True), "fmi2DoStep");
    refused += fmu.get_state(c, &state) != fmi2OK;
    if (state) {
      must(fmu.free_state(c, &state), "fmi2FreeFMUstate");
    }
    fmu.free_instance(c);
  } else {
    refused = 1;
  }
  failing_at = -1;
  *left = (long)mallinfo2().uordblks - (long)before;
  return refused;
}

static void hungry(void) {
  long refused = 0, leaked = 0, left = 0, allocations_of_one = 0;
  short_of_one(-1, &left); /* what the C library keeps for itself */
  short_of_one(-1, &left);
  allocations_of_one = allocations;
  for (long n = 0; n < allocations_of_one; ++n) {
    long total = 0;
    for (int again = 0; again < 50; ++again) { /* the allocator keeps what the first ones free for the next */
      const long before = messages;
      const int no = short_of_one(n, &left);
      messages = again == 49 ? messages : before;
      refused += again == 49 && no;
      total += again < 10 ? 0 : left;
    }
    leaked += total >= 40;
  }
  printf("%ld %ld %ld %ld\n", allocations_of_one, refused, messages, leaked);
}
