/* Keeps a library that is built on a new Linux loadable on an old one. The linker binds a function to its newest
 * version in the C library of the build; where that is no better for us, the oldest one is asked for by name. The
 * linker leads calls of log() here (--wrap=log, CMakeLists.txt).
 *
 * log() got a new version in glibc 2.29, which no longer sets errno the old way; its numbers are the same. */
#include <math.h>

#if defined(__GLIBC__) && defined(__x86_64__)
#define OLDEST "GLIBC_2.2.5"
#elif defined(__GLIBC__) && defined(__aarch64__)
#define OLDEST "GLIBC_2.17"
#endif

/* NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): names of the linker */
double __wrap_log(double x);
#ifdef OLDEST
double oldest_log(double x);
__asm__(".symver oldest_log,log@" OLDEST);
double __wrap_log(double x) {
  return oldest_log(x);
}
#else
double __real_log(double x);
double __wrap_log(double x) {
  return __real_log(x);
}
#endif
/* NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming) */
