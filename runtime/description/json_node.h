/* JSON texts, and their values together with where they stand. */
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tendonfmu {

using json = nlohmann::json;

/* Larger than any finger: 16 joints × 64 tendons × 256 working points with two-sided laws are about 50 MB. */
constexpr std::size_t max_document_bytes = std::size_t{64} << 20;

/* A description has seven levels. */
constexpr std::size_t max_document_depth = 32;

/* Parses a JSON text (RFC 8259, UTF-8, no comments). Throws description_error with line and column of a syntax error,
 * a number beyond the range of a double or a byte that is not UTF-8, or with the path of a key given twice. */
json parse_document(const char* text, std::size_t size);

/* A value of the description together with its path, so that whoever finds fault can say where. A node may be absent: a
 * key left out, null, or anything within either. */
class json_node {
 public:
  /* The whole document, which must outlive all nodes. */
  explicit json_node(const json& document) : value_(&document) {}

  bool absent() const { return value_->is_null(); }
  const json& value() const { return *value_; }
  const std::string& path() const { return path_; }

  /* Value of a key, or element index0 of a list; absent where there is none or this is no object or list. */
  json_node member(const std::string& key) const;
  json_node element(std::size_t index0) const;

  /* Follows a path below this node, such as "tendons[1].edge_friction[2].coulomb". */
  json_node find(const std::string& path) const;

  /* Throw description_error unless the value has the type; an absent one is missing. */
  const json_node& expect_object() const;
  const json_node& expect_list(std::size_t least, std::size_t most, const std::string& meaning) const;
  bool boolean() const;
  std::string text() const;

  /* Throws for the first key that is not among `known`. */
  const json_node& expect_keys(const std::vector<std::string>& known) const;
  const json_node& expect_keys_if_present(const std::vector<std::string>& known) const;

  /* Number of elements of a list. */
  std::size_t size() const { return value_->size(); }

  /* Throws "<path> = <value>: expected <expectation>", or "<path>: missing; expected <expectation>". */
  [[noreturn]] void refuse(const std::string& expectation) const;

 private:
  json_node(const json* value, std::string path) : value_(value), path_(std::move(path)) {}

  std::string shown() const;

  const json* value_;
  std::string path_;
};

}  // namespace tendonfmu
