/* Keeps a library that is built on a new Linux loadable on an old one. The linker binds a function to its newest
 * version in the C library of the build; where that is no better for us, the library has a function of that name, which
 * calls the oldest version by its full name. exports.map hides it.
 *
 * log() got a new version in glibc 2.29, which no longer sets errno the old way; its numbers are the same. */
#include <stdint.h>

#if defined(__GLIBC__) && defined(__x86_64__)
#define OLDEST "GLIBC_2.2.5"
#elif defined(__GLIBC__) && defined(__aarch64__)
#define OLDEST "GLIBC_2.17"
#endif

#ifdef OLDEST
double oldest_log(double x);
__asm__(".symver oldest_log,log@" OLDEST);

double log(double x);
double log(double x) {
  return oldest_log(x);
}
#else
typedef int no_glibc; /* a source is not empty */
#endif
