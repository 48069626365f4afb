#include "log.h"

#include <string.h>

void log_append_list(log_text* text, const char* format, va_list arguments) {
  message_add_list((message_line){text->bytes, sizeof text->bytes}, format, arguments);
}

void log_append(log_text* text, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  log_append_list(text, format, arguments);
  va_end(arguments);
}

log_text log_line(const char* format, ...) {
  log_text text = {.bytes = ""};
  va_list arguments;
  va_start(arguments, format);
  log_append_list(&text, format, arguments);
  va_end(arguments);
  return text;
}

fmu_status log_send(const log_target* target, fmu_status status, log_category category, const log_text* text) {
  if (target->logger && ((target->wanted | target->always) & (1u << category))) {
    target->send(target, status, log_category_names[category], text->bytes);
  }
  return status;
}

log_category log_find_category(const char* name) {
  for (int i = 0; i < LOG_CATEGORY_COUNT; ++i) {
    if (name && strcmp(name, log_category_names[i]) == 0) {
      return (log_category)i;
    }
  }
  return LOG_CATEGORY_COUNT;
}
