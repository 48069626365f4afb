/* Messages of the FMU: one line of text put together without the heap, and the importer's logger. */
#pragma once

#include "message.h"
#include "variable_table.h"

/* What an FMI function returns; the numbers are those of fmi2Status and fmi3Status. */
typedef enum fmu_status { FMU_OK, FMU_WARNING, FMU_DISCARD, FMU_ERROR } fmu_status;

enum { LOG_TEXT_BYTES = 512 };

typedef struct log_text {
  char bytes[LOG_TEXT_BYTES];
} log_text;

/* A line, by the conversions of message.h; too long a one is cut. */
log_text log_line(const char* format, ...) MESSAGE_FORMAT(1);
void log_append(log_text* text, const char* format, ...) MESSAGE_FORMAT(2);
void log_append_list(log_text* text, const char* format, va_list arguments);

/* Where messages go and which are wanted. The importer's logger is of another type in each version of FMI. */
typedef struct log_target {
  void (*logger)(void); /* may be NULL; `send` knows its type */
  void (*send)(const struct log_target* target, fmu_status status, const char* category, const char* text);
  void* environment;
  const char* instance_name;
  unsigned wanted; /* bit 1 << category */
  unsigned always; /* the same: sent whatever is wanted */
} log_target;

enum { LOG_NOTHING = 0, LOG_EVERYTHING = (1 << LOG_CATEGORY_COUNT) - 1 };

/* Returns the status. */
fmu_status log_send(const log_target* target, fmu_status status, log_category category, const log_text* text);

/* Category of a declared name; LOG_CATEGORY_COUNT when there is none. */
log_category log_find_category(const char* name);
