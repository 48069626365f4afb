/* A line of a message, put together with numbers that no locale changes. */
#pragma once

#include <locale>
#include <sstream>
#include <string>

namespace tendonfmu::plant {

/* Numbers appear with six digits. */
template <class... Parts>
std::string sentence(const Parts&... parts) {
  std::ostringstream line;
  line.imbue(std::locale::classic());
  (line << ... << parts);
  return line.str();
}

}  // namespace tendonfmu::plant
