#include "log.h"

#include <string.h>

#include "message.h"

static message_line line_of(log_text* text) {
  return (message_line){text->bytes, sizeof text->bytes};
}

void log_append(log_text* text, const char* more) {
  message_text(line_of(text), more);
}

void log_append_number(log_text* text, double value) {
  message_number(line_of(text), value);
}

void log_append_count(log_text* text, size_t value) {
  message_count(line_of(text), value);
}

log_text log_start(const char* function, const char* reason) {
  log_text text;
  message_start(line_of(&text), function);
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
