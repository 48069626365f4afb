/* One line of text put together without the heap, with a decimal point in every locale. */
#pragma once

#include <stddef.h>

typedef struct message_line {
  char* text; /* may be NULL when size is 0 */
  size_t size;
} message_line;

/* Starts over, then appends; too long a line is cut. Each leaves a terminating zero. */
void message_start(message_line line, const char* text);
void message_text(message_line line, const char* text);
void message_number(message_line line, double value);
void message_count(message_line line, size_t value);

/* Starts with "<name>[<index>]". */
void message_element(message_line line, const char* name, size_t index);
