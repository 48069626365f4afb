/* The table of keys as the reader needs it; description_keys.cpp is generated from it. */
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core_inside.h"

namespace tendonfmu {

/* number: read by its path in the core; per_joint: a list of them; vector: three. */
enum class key_kind {
  number,
  per_joint,
  vector,
  object,
  list,
  law,
  laws,
  edges,
  flag,
  word,
  name,
  format,
  extensions,
  estimates
};

struct key_fact {
  const char* object; /* whose key it is: a path without indices, such as "contact.bands"; "" is the document */
  const char* key;
  key_kind kind;
  bool required;
  std::uint32_t option;      /* of the model image: set where the key is there, a flag true, a word not the first */
  std::uint32_t least, most; /* elements of a list; 0: one per joint */
  const char* holds;         /* what a list holds, as errors say it */
  std::vector<std::string> words; /* the first one where it is left out */
};

/* Of all objects, in the order in which errors name them. */
const std::vector<key_fact>& key_facts();

/* The numbers of one side of a friction law. */
const std::vector<std::string>& law_keys();

/* What a number of the core's table that has a default is where it is left out. */
double default_of(model_item_kind kind);

}  // namespace tendonfmu
