#pragma once

#include <cstddef>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>

namespace tendonfmu {

/* The description is refused: one line with key path, value and expectation. */
struct description_error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/* A line put together from texts and numbers: six digits, which no locale changes. */
template <class... Parts>
std::string sentence(const Parts&... parts) {
  std::ostringstream line;
  line.imbue(std::locale::classic());
  (line << ... << parts);
  return line.str();
}

/* Text of the description as it may stand in a message: on one line, printable, at most `limit` bytes of valid UTF-8.
 */
std::string printable(const std::string& text, std::size_t limit = 60);

/* Copies a line of UTF-8 into text [size] with a terminating zero; too long a line ends before the character that no
 * longer fits. */
void copy_line(const char* line, char* text, std::size_t size) noexcept;

}  // namespace tendonfmu
