/* What the table of keys says of each object of the description; description_keys.cpp is generated from it. */
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tendonfmu {

/* A key of a list with one number per joint, or of numbers with an option bit of their own. */
struct number_key {
  const char* key;
  bool per_joint;
  bool required;
  const char* unit;     /* as errors say it: "N.m per N" */
  std::uint32_t option; /* of the model image, where the key has one of its own; 0: none */
};

/* The keys of an object, and the number_keys among them, in the order of the table. `object` is a path without indices,
 * such as "contact.rest" or "joints.cover"; "" is the document. */
const std::vector<std::string>& keys_of(const std::string& object);
std::vector<number_key> numbers_of(const std::string& object);

/* The words that a key takes; the first one where it is left out. */
const std::vector<std::string>& words_of(const std::string& path);

/* The numbers of one side of a friction law. */
const std::vector<std::string>& law_keys();

}  // namespace tendonfmu
