// Faults at every place of a JSON document: refused in one line that begins with the key path.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace document_faults {

using Json = nlohmann::json;

// What a reader says against a document; "" where it accepts it.
using Refusal = std::function<std::string(const Json&)>;

// Pointers to all values of a document.
inline std::vector<std::string> places(const Json& value, const std::string& pointer = "") {
  std::vector<std::string> all;
  if (!pointer.empty()) {
    all.push_back(pointer);
  }
  std::size_t index = 0;
  for (auto item = value.begin(); value.is_structured() && item != value.end(); ++item, ++index) {
    const std::string key = value.is_object() ? item.key() : std::to_string(index);
    const std::vector<std::string> inner = places(*item, pointer + "/" + key);
    all.insert(all.end(), inner.begin(), inner.end());
  }
  return all;
}

// "/physics/links/0/mass" as "physics.links[1].mass"
inline std::string path_of(const std::string& pointer) {
  std::string path;
  std::size_t from = 1;
  while (from <= pointer.size()) {
    const std::size_t end = std::min(pointer.find('/', from), pointer.size());
    const std::string word = pointer.substr(from, end - from);
    if (word.find_first_not_of("0123456789") == std::string::npos) {
      path += "[" + std::to_string(std::stoul(word) + 1) + "]";
    } else {
      path += (path.empty() ? "" : ".") + word;
    }
    from = end + 1;
  }
  return path;
}

inline bool is_plain(const std::string& line) {
  return !line.empty() && std::none_of(line.begin(), line.end(), [](unsigned char c) { return c < 0x20; });
}

inline Json changed(Json document, const std::string& pointer, const Json& value) {
  document[Json::json_pointer(pointer)] = value;
  return document;
}

// A wrong type, a number far out of range or an unknown key, at each of these places in turn; null is as if left out.
inline void expect_refused_everywhere(const Json& document, const std::vector<std::string>& pointers,
                                      const Refusal& refusal) {
  for (const std::string& pointer : pointers) {
    const Json& there = document.at(Json::json_pointer(pointer));
    const std::string path = path_of(pointer), without = refusal(changed(document, pointer, nullptr));
    const auto expect_refused = [&](const Json& value, const std::string& start) {
      const std::string line = refusal(changed(document, pointer, value));
      EXPECT_TRUE(is_plain(line)) << pointer << " = " << value;
      EXPECT_EQ(line.substr(0, start.size()), start) << pointer << " = " << value << ": " << line;
    };
    EXPECT_TRUE(without.empty() || is_plain(without)) << without;
    for (const Json& wrong : {Json("text"), Json(true), Json(Json::array()), Json{{"x", 1}}, Json{1, 2}, Json(1.5)}) {
      if (wrong.type() != there.type() && !(wrong.is_number() && there.is_number())) {
        expect_refused(wrong, path);
      }
    }
    if (there.is_number()) {
      expect_refused(1e300, path);
      expect_refused(-1e300, path);
    }
    if (there.is_object()) {
      Json more = there;
      more["tpyo"] = 1;
      expect_refused(more, path + ".tpyo: unknown key; expected one of ");
    }
  }
}

}  // namespace document_faults
