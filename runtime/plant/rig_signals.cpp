#include "rig_parts.h"
#include "rig_values.h"

namespace tendonfmu::plant {
namespace {

constexpr std::size_t most_knots = 2000000;
constexpr double longest_delay = 0.05;  // s

std::vector<double> read_column(const json_node& node, const char* key, std::size_t count, const range& allowed) {
  return numbers_in(node, key, count, allowed, false);
}

/* Times of knots: increasing. */
std::vector<double> read_times(const json_node& node) {
  const json_node list = node.member("time");
  list.expect_list(1, most_knots, "times");
  const std::vector<double> time = numbers_in(node, "time", list.size(), {0.0, 1e9, "s"}, false);
  for (std::size_t k = 1; k < time.size(); ++k) {
    if (!(time[k] > time[k - 1])) {
      list.element(k).refuse("a time after the knot before, s");
    }
  }
  return time;
}

knots read_joint_knots(const json_node& node) {
  node.expect_keys({"time", "position", "velocity", "acceleration"});
  knots knots;
  knots.time = read_times(node);
  const std::size_t count = knots.time.size();
  knots.position = read_column(node, "position", count, any_angle);
  knots.velocity = read_column(node, "velocity", count, {-1e4, 1e4, "rad/s"});
  knots.acceleration = read_column(node, "acceleration", count, {-1e7, 1e7, "rad/s2"});
  return knots;
}

/* One value for all channels, or one for each. */
std::vector<double> read_channels(const json_node& node, const char* key, std::size_t count, const range& allowed,
                                  double otherwise) {
  if (node.member(key).value().is_array()) {
    return numbers_in(node, key, count, allowed, false);
  }
  return std::vector<double>(count, number_in(node, key, allowed, otherwise));
}

sensor read_sensor(const json_node& parent, const char* name, std::size_t channels, const char* unit, bool has_play) {
  const json_node node = parent.member(name);
  if (!node.absent()) {
    std::vector<std::string> keys = {"noise", "resolution", "gain", "offset", "delay"};
    if (has_play) {
      keys.push_back("backlash");
    }
    node.expect_keys(keys);
  }
  sensor sensor;
  sensor.noise = number_in(node, "noise", {0.0, 1e6, unit}, 0.0);
  sensor.resolution = number_in(node, "resolution", {0.0, 1e6, unit}, 0.0);
  sensor.delay = number_in(node, "delay", {0.0, longest_delay, "s"}, 0.0);
  sensor.backlash = number_in(node, "backlash", {0.0, 1.0, unit}, 0.0);
  sensor.gain = read_channels(node, "gain", channels, {-1e3, 1e3, ""}, 1.0);
  sensor.offset = read_channels(node, "offset", channels, {-1e6, 1e6, unit}, 0.0);
  return sensor;
}

}  // namespace

void read_motion(const json_node& motion, rig* rig) {
  motion.expect_keys({"joints", "pretension"});
  const json_node joints = motion.member("joints"), pretension = motion.member("pretension");
  joints.expect_list(rig->joint_count(), rig->joint_count(), "joints' knots");
  for (std::size_t j = 0; j < rig->joint_count(); ++j) {
    rig->motion.push_back(read_joint_knots(joints.element(j)));
  }
  pretension.expect_keys({"time", "value"});
  knots& knots = rig->pretension;
  knots.time = read_times(pretension);
  knots.position = read_column(pretension, "value", knots.time.size(), {0.0, 1e5, "N", true});
  knots.velocity.assign(knots.time.size(), 0.0);
  knots.acceleration.assign(knots.time.size(), 0.0);
}

void read_sensors(const json_node& node, rig* rig) {
  node.expect_keys_if_present(
      {"rate", "tendon_force", "tendon_position", "joint_position", "joint_velocity", "external_torque"});
  const std::size_t n = rig->joint_count(), m = rig->tendon_count();
  sensors& sensors = rig->sensors;
  sensors.rate = number_in(node, "rate", {1.0, 1e5, "Hz"}, 1000.0);
  sensors.tendon_force = read_sensor(node, "tendon_force", m, "N", false);
  sensors.tendon_position = read_sensor(node, "tendon_position", m, "m", true);
  sensors.joint_position = read_sensor(node, "joint_position", n, "rad", false);
  sensors.joint_velocity = read_sensor(node, "joint_velocity", n, "rad/s", false);
  sensors.external_torque = read_sensor(node, "external_torque", n, "N·m", false);
}

}  // namespace tendonfmu::plant
