/* Included by fmu_calls.c, once. */
/* --- the host's modes -----------------------------------------------------------------------------------------------
 */

typedef struct host_modes {
  int rounding;
  unsigned mxcsr;
  unsigned short x87;
  mode_t umask;
  char locale[64], folder[512];
  void (*handler)(int);
} host_modes;

static host_modes modes_now(void) {
  host_modes m = {.rounding = fegetround()};
#if defined(__x86_64__)
  m.mxcsr = __builtin_ia32_stmxcsr() & 0xffc0u; /* all but the flags of what has happened */
  __asm__ volatile("fnstcw %0" : "=m"(m.x87));
#endif
  m.umask = umask(0);
  umask(m.umask);
  snprintf(m.locale, sizeof m.locale, "%s", setlocale(LC_ALL, NULL));
  if (!getcwd(m.folder, sizeof m.folder)) {
    fail("getcwd", "no current folder");
  }
  struct sigaction action;
  sigaction(SIGFPE, NULL, &action);
  m.handler = action.sa_handler;
  return m;
}

static long calls, changed;
static host_modes expected;

static void after_a_call(void) {
  const host_modes now = modes_now();
  ++calls;
  changed += now.rounding != expected.rounding || now.mxcsr != expected.mxcsr || now.x87 != expected.x87 ||
             now.umask != expected.umask || strcmp(now.locale, expected.locale) != 0 ||
             strcmp(now.folder, expected.folder) != 0 || now.handler != expected.handler;
}

static double* inputs_of_all; /* [samples × inputs], made in the usual mode */

static void in_these_modes(long samples, double* rows) {
  expected = modes_now();
  fmi2Component c = instance();
  after_a_call();
  must(fmu.set_up(c, 0, 0.0, 0.0, 0, 0.0), "fmi2SetupExperiment");
  after_a_call();
  must(fmu.enter(c), "fmi2EnterInitializationMode");
  after_a_call();
  must(fmu.set(c, fmu.input, fmu.inputs, inputs_of_all), "fmi2SetReal");
  must(fmu.leave(c), "fmi2ExitInitializationMode");
  after_a_call();
  for (long k = 1; k < samples; ++k) {
    must(fmu.set(c, fmu.input, fmu.inputs, inputs_of_all + (size_t)k * fmu.inputs), "fmi2SetReal");
    after_a_call();
    must(fmu.step(c, 0.0009765625 * (double)k, 0.0009765625, fmi2True), "fmi2DoStep"); /* exact in every mode */
    after_a_call();
    must(fmu.get(c, fmu.output, fmu.outputs, rows + (size_t)k * fmu.outputs), "fmi2GetReal");
    after_a_call();
  }
  if (fmu.step(c, -1.0, 0.001, fmi2True) != fmi2Error) { /* a refused call writes numbers into a text */
    fail("fmi2DoStep", "a step back is not refused");
  }
  after_a_call();
  size_t size = 0;
  free(saved(c, &size));
  after_a_call();
  fmu.free_instance(c);
  after_a_call();
}

static void host(long samples) {
  static const int roundings[] = {FE_TONEAREST, FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};
  const size_t numbers = (size_t)samples * fmu.outputs;
  double* usual = calloc(numbers, sizeof *usual);
  double* rows = calloc(numbers, sizeof *rows);
  double apart = 0.0, largest = 0.0;
  int modes = 0;
  const char* comma = getenv("RELIABILITY_LOCALE");
  inputs_of_all = calloc((size_t)samples * fmu.inputs, sizeof *inputs_of_all);
  for (long k = 0; k < samples; ++k) {
    double* row = inputs_of_all + (size_t)k * fmu.inputs;
    double* angle = row + 2 * fmu.tendons;
    motion_inputs(k, 0, fmu.tendons, fmu.joints, row, row + fmu.tendons, angle, angle + fmu.joints);
  }
  for (int r = 0; r < 4; ++r) {
    for (int flush = 0; flush < 2; ++flush) {
      fesetround(roundings[r]);
#if defined(__x86_64__)
      __builtin_ia32_ldmxcsr((__builtin_ia32_stmxcsr() & ~0x8040u) | (flush ? 0x8040u : 0u));
#endif
      if (comma && !setlocale(LC_ALL, comma)) {
        fail(comma, "no such locale");
      }
      in_these_modes(samples, modes ? rows : usual);
      fesetround(FE_TONEAREST);
      for (size_t i = 0; modes && i < numbers; ++i) {
        apart = fmax(apart, fabs(rows[i] - usual[i]));
        largest = fmax(largest, fabs(usual[i]));
      }
      ++modes;
    }
  }
  setlocale(LC_ALL, "C");
  printf("%d %ld %ld %.3g %.3g\n", modes, calls, changed, apart, largest);
  free(inputs_of_all);
  free(usual);
  free(rows);
}
