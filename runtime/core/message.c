#include "message.h"

#include <stdio.h>
#include <string.h>

void message_start(message_line line, const char* text) {
  if (line.size) {
    line.text[0] = 0;
  }
  message_text(line, text);
}

void message_text(message_line line, const char* text) {
  if (!line.size) {
    return;
  }
  const size_t used = strlen(line.text), room = line.size - 1 - used;
  const size_t wanted = strlen(text), taken = wanted < room ? wanted : room;
  for (size_t i = 0; i < taken; ++i) {
    /* texts of the caller may hold anything; a line stays a line */
    line.text[used + i] = (unsigned char)text[i] < 0x20 || text[i] == 0x7f ? '?' : text[i];
  }
  line.text[used + taken] = 0;
}

void message_number(message_line line, double value) {
  char digits[40], plain[40];
  size_t length = 0;
  /* the shortest of the usual precisions that reads back as the same number */
  for (int precision = 6; precision <= 17; precision += precision == 6 ? 9 : 2) {
    double back = 0.0;
    snprintf(digits, sizeof digits, "%.*g", precision, value);
    if (sscanf(digits, "%lf", &back) == 1 && back == value) {
      break;
    }
  }
  for (const char* c = digits; *c; ++c) {
    const int known = strchr("+-0123456789eainf", *c) != NULL;
    if (known || (length && plain[length - 1] != '.')) {
      plain[length++] = known ? *c : '.';
    }
  }
  plain[length] = 0;
  message_text(line, plain);
}

void message_count(message_line line, size_t value) {
  char digits[24];
  snprintf(digits, sizeof digits, "%llu", (unsigned long long)value);
  message_text(line, digits);
}

void message_element(message_line line, const char* name, size_t index) {
  message_start(line, name);
  message_text(line, "[");
  message_count(line, index);
  message_text(line, "]");
}
