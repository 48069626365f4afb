/* One line of text put together without the heap, with a decimal point in every locale. */
#pragma once

#include <stdarg.h>
#include <stddef.h>

typedef struct message_line {
  char* text; /* may be NULL when size is 0 */
  size_t size;
} message_line;

#if defined(__GNUC__)
#define MESSAGE_FORMAT(at) __attribute__((format(printf, at, at + 1)))
#else
#define MESSAGE_FORMAT(at)
#endif

/* Starts over, or appends; too long a line is cut. Each leaves a terminating zero. Of printf's conversions %s, %g and
 * %zu; numbers have all digits that they need. Returns -1: a caller that refuses returns it. */
int message_write(message_line line, const char* format, ...) MESSAGE_FORMAT(2);
int message_add(message_line line, const char* format, ...) MESSAGE_FORMAT(2);
void message_add_list(message_line line, const char* format, va_list arguments);
