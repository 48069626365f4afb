#include "json_node.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "description_error.h"

namespace tendonfmu {

/* --- a text ---------------------------------------------------------------------------------------------------------
 */

namespace {

/* at a place in a text; lines and columns (bytes) count from 1 */
description_error syntax_error(const char* text, const char* place, const std::string& reason) {
  const auto line = std::count(text, place, '\n') + 1;
  const char* start = place;
  while (start > text && start[-1] != '\n') {
    --start;
  }
  return description_error("JSON, line " + std::to_string(line) + ", column " + std::to_string(place - start + 1) +
                           ": " + reason);
}

/* Builds the tree from the parser's events. The parser's own tree keeps the last of two equal keys without a word, and
 * has no limit of depth. */
class tree_builder : public nlohmann::json_sax<json> {
 public:
  tree_builder(const char* text, std::size_t size) : text_(text), size_(size) {}

  json take_tree() { return std::move(root_); }

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t&) override { return add(value); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    if (open_.back().value->contains(name)) {
      throw description_error(path() + printable(name) + ": key given twice");
    }
    open_.back().key = name;
    return true;
  }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& error) override {
    /* the parser counts the character it stumbled over */
    const std::size_t before = std::min(position > 0 ? position - 1 : 0, size_);
    throw syntax_error(text_, text_ + before, reason(error.what()));
  }

 private:
  struct level {
    json* value;
    std::string key; /* of an object: the key being read */
  };

  /* the parser's text without its own idea of the position, and without bytes that are not ASCII */
  static std::string reason(const std::string& what) {
    const std::size_t column = what.find("column "), colon = what.find(": ", column);
    std::string text = column == std::string::npos || colon == std::string::npos ? what : what.substr(colon + 2);
    const std::size_t bracket = text.find("] ");
    if (text.rfind("[json.exception", 0) == 0 && bracket != std::string::npos) {
      text = text.substr(bracket + 2);
    }
    std::replace_if(
        text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) > 0x7e; }, '?');
    return printable(text, 200);
  }

  /* path of the object being read, as a prefix of its keys */
  std::string path() const {
    std::string text;
    for (std::size_t i = 0; i + 1 < open_.size(); ++i) {
      const level& l = open_[i];
      text += l.value->is_array() ? "[" + std::to_string(l.value->size()) + "]"
                                  : (text.empty() ? "" : ".") + printable(l.key);
    }
    return text.empty() ? text : text + ".";
  }

  json* put(json&& value) {
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    json& parent = *open_.back().value;
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    return &(parent[open_.back().key] = std::move(value));
  }

  bool add(json&& value) {
    put(std::move(value));
    return true;
  }

  bool open(json&& container) {
    if (open_.size() == max_document_depth) {
      throw description_error("JSON nested too deeply: expected at most " + std::to_string(max_document_depth) +
                              " levels");
    }
    /* a parent gets no further element while this one is open, so the pointer holds */
    open_.push_back({put(std::move(container)), {}});
    return true;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  const char* text_;
  std::size_t size_;
  json root_;
  std::vector<level> open_;
};

}  // namespace

json parse_document(const char* text, std::size_t size) {
  if (size > max_document_bytes) {
    throw description_error("JSON of " + std::to_string(size) + " bytes: expected at most " +
                            std::to_string(max_document_bytes));
  }
  /* the parser would take it for the end of the text */
  if (const void* zero = std::memchr(text, 0, size)) {
    throw syntax_error(text, static_cast<const char*>(zero), "a zero byte; expected text");
  }
  tree_builder builder(text, size);
  json::sax_parse(text, text + size, &builder);
  return builder.take_tree();
}

/* --- a value and where it stands ------------------------------------------------------------------------------------
 */

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
