#include "description_error.h"

#include <cstring>

namespace tendonfmu {

static bool is_continuation(char byte) {
  return (static_cast<unsigned char>(byte) & 0xc0) == 0x80;
}

/* largest length <= limit that does not end within a character */
static std::size_t whole_characters(const char* text, std::size_t length, std::size_t limit) {
  if (length <= limit) {
    return length;
  }
  while (limit > 0 && is_continuation(text[limit])) {
    --limit;
  }
  return limit;
}

std::string printable(const std::string& text, std::size_t limit) {
  const std::size_t length = whole_characters(text.data(), text.size(), limit);
  std::string line = text.substr(0, length);
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      c = '?';
    }
  }
  return length < text.size() ? line + "..." : line;
}

void copy_line(const char* line, char* text, std::size_t size) noexcept {
  if (size == 0) {
    return;
  }
  const std::size_t length = whole_characters(line, std::strlen(line), size - 1);
  std::memcpy(text, line, length);
  text[length] = 0;
}

}  // namespace tendonfmu
