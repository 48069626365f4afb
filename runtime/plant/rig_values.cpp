#include "rig_values.h"

#include <cmath>

#include "sentence.h"

namespace tendonfmu::plant {
namespace {

std::string said(const range& allowed) {
  return sentence("a number ", allowed.open ? ">" : ">=", " ", allowed.low, " and <= ", allowed.high,
                  *allowed.unit ? " " : "", allowed.unit);
}

}  // namespace

double number_of(const json_node& node, const range& allowed, std::optional<double> otherwise) {
  if (node.absent() && otherwise) {
    return *otherwise;
  }
  if (!node.value().is_number()) {
    node.refuse(said(allowed));
  }
  const double x = node.value().get<double>();
  if (!(x >= allowed.low && x <= allowed.high) || (allowed.open && x == allowed.low)) {
    node.refuse(said(allowed));
  }
  return x;
}

double number_in(const json_node& parent, const char* key, const range& allowed, std::optional<double> otherwise) {
  return number_of(parent.member(key), allowed, otherwise);
}

std::vector<double> numbers_in(const json_node& parent, const char* key, std::size_t count, const range& allowed,
                               bool optional) {
  const json_node list = parent.member(key);
  if (list.absent() && optional) {
    return std::vector<double>(count, 0.0);
  }
  list.expect_list(count, count, "numbers");
  std::vector<double> numbers(count);
  for (std::size_t k = 0; k < count; ++k) {
    numbers[k] = number_of(list.element(k), allowed);
  }
  return numbers;
}

three three_in(const json_node& parent, const char* key, const range& allowed, std::optional<three> otherwise) {
  if (parent.member(key).absent() && otherwise) {
    return *otherwise;
  }
  const std::vector<double> numbers = numbers_in(parent, key, 3, allowed, false);
  return {numbers[0], numbers[1], numbers[2]};
}

three direction_in(const json_node& parent, const char* key) {
  three direction = three_in(parent, key, {-1e6, 1e6, ""}, std::nullopt);
  const double length =
      std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]);
  if (length < 1e-12) {
    parent.member(key).refuse("a direction [x, y, z] that is not zero");
  }
  for (double& x : direction) {
    x /= length;
  }
  return direction;
}

std::size_t index_in(const json_node& parent, const char* key, std::size_t low, std::size_t high,
                     std::optional<std::size_t> otherwise) {
  const json_node node = parent.member(key);
  if (node.absent() && otherwise) {
    return *otherwise;
  }
  const double x = node.value().is_number() ? node.value().get<double>() : -1.0;
  if (!(x >= static_cast<double>(low) && x <= static_cast<double>(high)) || x != std::floor(x)) {
    node.refuse("a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  }
  return static_cast<std::size_t>(x);
}

std::size_t choice_in(const json_node& parent, const char* key, const std::vector<std::string>& choices) {
  const json_node node = parent.member(key);
  if (node.absent()) {
    return 0;
  }
  std::string list;
  for (std::size_t k = 0; k < choices.size(); ++k) {
    if (node.value().is_string() && node.text() == choices[k]) {
      return k;
    }
    list += (k ? " or \"" : "\"") + choices[k] + "\"";
  }
  node.refuse(list);
}

}  // namespace tendonfmu::plant
