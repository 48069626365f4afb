#include "log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void log_append(log_text* text, const char* more) {
  size_t length = strlen(more);
  if (length > LOG_TEXT_BYTES - 1 - text->length) {
    length = LOG_TEXT_BYTES - 1 - text->length;
  }
  memcpy(text->bytes + text->length, more, length);
  text->length += length;
  text->bytes[text->length] = '\0';
}

/* 1 for what a number in the C locale is made of, "inf" and "nan" included */
static int belongs_to_number(char c) {
  return c != '\0' && strchr("0123456789+-einfa", c) != NULL;
}

void log_append_number(log_text* text, double value) {
  char digits[40], plain[40];
  size_t length = 0;
  snprintf(digits, sizeof digits, "%.15g", value);
  if (value == value && strtod(digits, NULL) != value) {
    snprintf(digits, sizeof digits, "%.17g", value);
  }

  /* what else stands in it, in one byte or more, is the decimal separator of the host's locale */
  for (const char* c = digits; *c; ++c) {
    if (belongs_to_number(*c)) {
      plain[length++] = *c;
    } else if (length == 0 || plain[length - 1] != '.') {
      plain[length++] = '.';
    }
  }
  plain[length] = '\0';
  log_append(text, plain);
}

void log_append_count(log_text* text, size_t value) {
  char digits[24];
  snprintf(digits, sizeof digits, "%llu", (unsigned long long)value);
  log_append(text, digits);
}

log_text log_start(const char* function, const char* reason) {
  log_text text;
  text.length = 0;
  log_append(&text, function);
  log_append(&text, ": ");
  log_append(&text, reason);
  return text;
}

void log_send(const log_target* target, fmu_status status, log_category category, const log_text* text) {
  if (target->logger && ((target->wanted | target->always) & (1u << category))) {
    target->send(target, status, log_category_names[category], text->bytes);
  }
}

log_category log_find_category(const char* name) {
  for (int i = 0; i < LOG_CATEGORY_COUNT; ++i) {
    if (name && strcmp(name, log_category_names[i]) == 0) {
      return (log_category)i;
    }
  }
  return LOG_CATEGORY_COUNT;
}
