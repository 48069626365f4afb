#include "contact_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <stdexcept>
#include <utility>

using tendonfmu::status;

namespace {

double seconds(std::int64_t nanoseconds) {
  return 1e-9 * static_cast<double>(nanoseconds);
}

std::string text(double duration) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.6g s", duration);
  return buffer;
}

std::string listed(tendonfmu::span<const std::string> names) {
  std::string line;
  for (const std::string& name : names) {
    line += (line.empty() ? "" : ", ") + name;
  }
  return line.empty() ? "no names" : line;
}

std::string counted(std::size_t count, const char* what) {
  return std::to_string(count) + " " + what;
}

}  // namespace

contact_estimator::contact_estimator(tendonfmu::finger finger, settings chosen)
    : finger_(std::move(finger)),
      settings_(std::move(chosen)),
      untouched_(finger_.state_size()),
      force_(finger_.tendon_count()),
      position_(finger_.tendon_count()),
      torque_(finger_.joint_count()) {
  const std::vector<std::string>& names = settings_.tendon_names;
  if (names.size() != finger_.tendon_count()) {
    throw std::invalid_argument("tendon_names: " + counted(names.size(), "names, the finger has ") +
                                counted(finger_.tendon_count(), "tendons"));
  }
  if (settings_.joints != finger_.joint_count()) {
    throw std::invalid_argument("joint_names: " + counted(settings_.joints, "names, the finger has ") +
                                counted(finger_.joint_count(), "joints"));
  }
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    throw std::invalid_argument("tendon_names: a name is there twice: " + listed(names));
  }
  if (finger_.save_state(untouched_) != status::ok) {
    throw std::invalid_argument(finger_.last_error());
  }
}

outcome contact_estimator::refuse(std::string reason) {
  reason_ = std::move(reason);
  return outcome::refused;
}

// Where each tendon is in a message with these names. Most messages have the names of the one before.
bool contact_estimator::find_columns(tendonfmu::span<const std::string> names) {
  if (!columns_.empty() && std::equal(names.begin(), names.end(), names_.begin(), names_.end())) {
    return true;
  }
  columns_.clear();
  std::vector<std::size_t> found;
  for (const std::string& tendon : settings_.tendon_names) {
    const std::string* at = std::find(names.begin(), names.end(), tendon);
    if (at == names.end()) {
      refuse("tendon " + tendon + " is missing; the message has " + listed(names));
      return false;
    }
    if (std::find(at + 1, names.end(), tendon) != names.end()) {
      refuse("tendon " + tendon + " is there twice");
      return false;
    }
    found.push_back(static_cast<std::size_t>(at - names.begin()));
  }
  columns_ = std::move(found);
  names_.assign(names.begin(), names.end());
  return true;
}

// Forces and positions of the message, in the order of the description.
bool contact_estimator::gather(const tendon_state& message) {
  for (const auto& [name, values] : {std::pair("effort", message.force), std::pair("position", message.position)}) {
    if (values.size() != message.names.size()) {
      refuse(std::string(name) + ": " + counted(values.size(), "values for ") + counted(message.names.size(), "names"));
      return false;
    }
  }
  if (!find_columns(message.names)) {
    return false;
  }
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    force_[i] = message.force[columns_[i]];
    position_[i] = message.position[columns_[i]];
    if (!std::isfinite(force_[i]) || !std::isfinite(position_[i])) {
      refuse(std::string(std::isfinite(force_[i]) ? "position" : "effort") + " of tendon " + settings_.tendon_names[i] +
             " is not finite");
      return false;
    }
  }
  return true;
}

outcome contact_estimator::begin(const tendon_state& message, outcome meaning) {
  if (finger_.initialise(0.0, {force_, position_}) != status::ok) {
    return refuse(finger_.last_error());
  }
  first_ = last_ = message.stamp;
  return meaning;
}

outcome contact_estimator::step(const tendon_state& message) {
  const double passed = seconds(message.stamp - last_);
  if (passed == 0.0) {
    reason_ = "stamp " + text(seconds(message.stamp)) + " is that of the last message; does the driver set it?";
    return outcome::repeated;
  }
  if (-passed > settings_.restart_after) {
    reason_ = "the stamp went back by " + text(-passed) + ": starting anew";
    return finger_.restore_state(untouched_) == status::ok ? begin(message, outcome::restarted)
                                                           : refuse(finger_.last_error());
  }
  if (passed < 0.0) {
    return refuse("the stamp goes back by " + text(-passed));
  }
  if (finger_.step(seconds(message.stamp - first_), {force_, position_}) != status::ok) {
    return refuse(finger_.last_error());
  }
  last_ = message.stamp;
  if (passed > settings_.longest_gap) {
    reason_ = "messages are missing: " + text(passed) + " since the last one";
    return outcome::taken_after_gap;
  }
  return outcome::taken;
}

outcome contact_estimator::take(const tendon_state& message) {
  arrived_ = true;
  if (!gather(message)) {
    return outcome::refused;
  }
  const outcome found = finger_.is_initialised() ? step(message) : begin(message, outcome::taken);
  if (found != outcome::refused && found != outcome::repeated) {
    tendonfmu::outputs wanted;
    wanted.compensated_torque = torque_;
    wanted.contact = tendonfmu::one(contact_);
    if (finger_.get_outputs(wanted) != status::ok) {
      return refuse(finger_.last_error());
    }
  }
  return found;
}

bool contact_estimator::watch(std::int64_t now) {
  if (arrived_ || !watched_) {
    heard_ = now;
  }
  arrived_ = false;
  watched_ = true;
  const double silent = seconds(now - heard_);
  if (silent <= settings_.longest_gap) {
    return true;
  }
  reason_ = "no message for " + text(silent);
  return false;
}
