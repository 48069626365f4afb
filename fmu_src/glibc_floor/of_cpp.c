/* As of_c.c, for what C++ in this FMU asks of the C library: names that old ones do not have, or have
 * elsewhere (libpthread). Defined here they are the library's own; exports.map hides them. */
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>

#ifdef __GLIBC__

/* glibc 2.32: whether the process has one thread, so that counters need no atomic operations. 0 is always right. */
/* NOLINTNEXTLINE(bugprone-reserved-identifier,readability-identifier-naming): glibc's name */
extern char __libc_single_threaded;
char __libc_single_threaded = 0;

/* glibc 2.34 moved it from libpthread to libc. 0 is PTHREAD_ONCE_INIT: not begun. */
enum { RUNNING = 1, DONE = 2 };

int pthread_once(pthread_once_t* once, void (*routine)(void)) {
  int state = PTHREAD_ONCE_INIT;
  if (__atomic_compare_exchange_n(once, &state, RUNNING, 0, __ATOMIC_ACQUIRE, __ATOMIC_ACQUIRE)) {
    routine();
    __atomic_store_n(once, DONE, __ATOMIC_RELEASE);
    return 0;
  }
  while (__atomic_load_n(once, __ATOMIC_ACQUIRE) != DONE) {
    sched_yield();
  }
  return 0;
}

/* pow() of CVODE got a new version in 2.29, as log() did (of_c.c). */
#ifdef __x86_64__
__asm__(".symver oldest_pow,pow@GLIBC_2.2.5");
#else
__asm__(".symver oldest_pow,pow@GLIBC_2.17");
#endif
double oldest_pow(double base, double exponent);
double pow(double base, double exponent);
double pow(double base, double exponent) {
  return oldest_pow(base, exponent);
}

/* glibc 2.38: the names that C++ calls strtol() and so on by. They take binary numbers too, which JSON does not have.
 * C11 knows the old names alone. */
/* NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): glibc's names */
#define OLD_NAME(type, name)                                     \
  type __isoc23_##name(const char* text, char** end, int base);  \
  type __isoc23_##name(const char* text, char** end, int base) { \
    return name(text, end, base);                                \
  }
OLD_NAME(long, strtol)
OLD_NAME(long long, strtoll)
OLD_NAME(unsigned long, strtoul)
OLD_NAME(unsigned long long, strtoull)
/* NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming) */

#endif
