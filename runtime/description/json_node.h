/* A value of the description together with its path, so that whoever finds fault can say where. A node may be absent:
 * a key left out, null, or anything within either. */
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "json_document.h"

namespace tendonfmu {

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
