/* What the table of keys says of each object of the description; description_keys.cpp is generated from it. */
#ifndef TENDONFMU_DESCRIPTION_KEYS_H
#define TENDONFMU_DESCRIPTION_KEYS_H

#include <cstdint>
#include <string>
#include <vector>

namespace tendonfmu {

/* A key that holds a number or a list of numbers. */
struct number_key {
  const char* key;
  bool per_joint; /* a list, one number per joint */
  bool required;
  const char* unit;     /* as errors say it: "N.m per N" */
  std::uint32_t option; /* of the model image, where the key has one of its own; 0: none */
};

/* The keys of an object, and those of them that are numbers, in the order of the table. `object` is a path without
 * indices, such as "contact.rest" or "joints.cover"; "" is the document. */
const std::vector<std::string>& keys_of(const std::string& object);
const std::vector<number_key>& numbers_of(const std::string& object);

/* The words that a key takes; the first one where it is left out. */
const std::vector<std::string>& words_of(const std::string& path);

/* The numbers of one side of a friction law. */
const std::vector<std::string>& law_keys();

}  // namespace tendonfmu

#endif
