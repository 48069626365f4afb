#include "json_node.h"

#include <algorithm>

#include "description_error.h"

namespace tendonfmu {

static const json nothing = nullptr;

json_node json_node::member(const std::string& key) const {
  const bool there = value_->is_object() && value_->contains(key);
  return {there ? &(*value_)[key] : &nothing, path_.empty() ? key : path_ + "." + key};
}

json_node json_node::element(std::size_t index0) const {
  const bool there = value_->is_array() && index0 < value_->size();
  return {there ? &(*value_)[index0] : &nothing, path_ + "[" + std::to_string(index0 + 1) + "]"};
}

json_node json_node::find(const std::string& path) const {
  json_node node = *this;
  std::size_t from = 0;
  while (from < path.size()) {
    if (path[from] == '[' || path[from] == ',') {
      const std::size_t end = path.find_first_of(",]", from + 1);
      node = node.element(std::stoul(path.substr(from + 1, end - from - 1)) - 1);
      from = path[end] == ']' ? end + 1 : end;
      continue;
    }
    from += path[from] == '.';
    const std::size_t end = std::min(path.find_first_of(".[", from), path.size());
    node = node.member(path.substr(from, end - from));
    from = end;
  }
  return node;
}

std::string json_node::shown() const {
  if (value_->is_object()) {
    return "{...}";
  }
  if (value_->is_array()) {
    return "[...]";
  }
  return printable(value_->dump(), 40);
}

void json_node::refuse(const std::string& expectation) const {
  const std::string where = path_.empty() ? "description" : path_;
  throw description_error(where + (absent() ? ": missing; expected " : " = " + shown() + ": expected ") + expectation);
}

const json_node& json_node::expect_object() const {
  if (!value_->is_object()) {
    refuse("an object");
  }
  return *this;
}

/* "numbers in m" becomes "number in m". */
static std::string singular(const std::string& meaning) {
  const std::size_t end = std::min(meaning.find_first_of(" ,"), meaning.size());
  const bool is_plural = end > 0 && meaning[end - 1] == 's';
  return is_plural ? meaning.substr(0, end - 1) + meaning.substr(end) : meaning;
}

const json_node& json_node::expect_list(std::size_t least, std::size_t most, const std::string& meaning) const {
  const std::string range = least == most
                                ? std::to_string(most)
                                : (least ? std::to_string(least) + " to " : "at most ") + std::to_string(most);
  const std::string expectation = "a list of " + range + " " + (most == 1 ? singular(meaning) : meaning);
  if (!value_->is_array()) {
    refuse(expectation);
  }
  if (size() < least || size() > most) {
    throw description_error(path_ + " has " + std::to_string(size()) + (size() == 1 ? " element" : " elements") +
                            ": expected " + expectation);
  }
  return *this;
}

bool json_node::boolean() const {
  if (!value_->is_boolean()) {
    refuse("true or false");
  }
  return value_->get<bool>();
}

std::string json_node::text() const {
  if (!value_->is_string()) {
    refuse("a text");
  }
  return value_->get<std::string>();
}

const json_node& json_node::expect_keys(const std::vector<std::string>& known) const {
  expect_object();
  for (auto item = value_->begin(); item != value_->end(); ++item) {
    if (std::find(known.begin(), known.end(), item.key()) == known.end()) {
      std::string list;
      for (const std::string& key : known) {
        list += (list.empty() ? "" : ", ") + key;
      }
      throw description_error((path_.empty() ? "" : path_ + ".") + printable(item.key()) +
                              ": unknown key; expected one of " + list);
    }
  }
  return *this;
}

const json_node& json_node::expect_keys_if_present(const std::vector<std::string>& known) const {
  return absent() ? *this : expect_keys(known);
}

}  // namespace tendonfmu
