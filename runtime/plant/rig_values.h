/* Numbers of a rig file with their ranges: read, or refused with key path, value, range and unit. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "json_node.h"
#include "rig.h"

namespace tendonfmu::plant {

/* Allowed values: low <= x <= high, or low < x with `open`. */
struct range {
  double low, high;
  const char* unit;
  bool open = false;
};

constexpr range any_angle = {-100.0, 100.0, "rad"};
constexpr range any_length = {-10.0, 10.0, "m"};

/* The node's own value; `otherwise` where it is absent, which is refused when there is none. */
double number_of(const json_node& node, const range& allowed, std::optional<double> otherwise = {});
double number_in(const json_node& parent, const char* key, const range& allowed, std::optional<double> otherwise = {});

/* A list of `count` numbers; absent: zeros where `optional`. */
std::vector<double> numbers_in(const json_node& parent, const char* key, std::size_t count, const range& allowed,
                               bool optional = true);
three three_in(const json_node& parent, const char* key, const range& allowed, std::optional<three> otherwise);

/* A direction: not zero; comes back with length 1. */
three direction_in(const json_node& parent, const char* key);

/* A whole number of low..high. */
std::size_t index_in(const json_node& parent, const char* key, std::size_t low, std::size_t high,
                     std::optional<std::size_t> otherwise = {});

/* Position of a text among `choices`; the first where it is absent. */
std::size_t choice_in(const json_node& parent, const char* key, const std::vector<std::string>& choices);

/* The tendons' friction: sites in the order in which a tendon passes them. The finger has been checked by the core. */
void read_friction(const json_node& finger, const json_node& physics, rig* rig);

/* What no single number shows: a pretension that can be held, a start within the limits, stiffness within reason,
 * friction that leaves some tension. Throws description_error. Sets the null vector. */
void check_rig(const json_node& document, rig* rig);

}  // namespace tendonfmu::plant
