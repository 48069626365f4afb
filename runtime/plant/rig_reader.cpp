#include <cmath>

#include "description_error.h"
#include "rig_values.h"
#include "tendonfmu_description.h"

namespace tendonfmu::plant {

/* --- numbers with their ranges ------------------------------------------------------------------------------------ */

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
  const three direction = three_in(parent, key, {-1e6, 1e6, ""}, std::nullopt);
  const double length = direction.norm();
  if (length < 1e-12) {
    parent.member(key).refuse("a direction [x, y, z] that is not zero");
  }
  return direction / length;
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

namespace {

/* --- links, tendons, motors --------------------------------------------------------------------------------------- */

constexpr double pi_limit = 3.14159;  // rad: a joint without limits still cannot turn round

void read_inertia(const json_node& node, link* link) {
  link->inertia = three_in(node, "inertia", {0.0, 1e3, "kg m2", true}, std::nullopt);
  const three& i = link->inertia;
  // no body has a moment of inertia larger than the sum of the others
  if (2.0 * i.maxCoeff() > (1.0 + 1e-9) * i.sum()) {
    node.member("inertia").refuse("three moments of inertia none of which exceeds the sum of the two others");
  }
}

void read_limits(const json_node& node, link* link) {
  const json_node limits = node.member("limits");
  if (limits.absent()) {
    link->lower = -pi_limit;
    link->upper = pi_limit;
  } else {
    limits.expect_keys({"lower", "upper", "stiffness", "damping"});
    link->lower = number_in(limits, "lower", any_angle);
    link->upper = number_in(limits, "upper", any_angle);
    if (!(link->upper > link->lower)) {
      limits.member("upper").refuse("an angle above `lower`, rad");
    }
  }
  link->stop_stiffness = number_in(limits, "stiffness", {0.0, 1e6, "N·m/rad", true}, 5.0);
  link->stop_damping = number_in(limits, "damping", {0.0, 1e3, "N·m·s/rad"}, 0.01);
}

void read_links(const json_node& finger, const json_node& physics, rig* rig) {
  const json_node joints = finger.member("joints"), links = physics.member("links");
  const std::size_t n = joints.size();
  links.expect_list(n, n, "links, one per joint");
  rig->links.resize(n);
  for (std::size_t j = 0; j < n; ++j) {
    const json_node node = links.element(j), cover = joints.element(j).member("cover");
    node.expect_keys({"axis", "offset", "mass", "centre_of_mass", "inertia", "limits", "cover_hardening", "damping"});
    link& link = rig->links[j];
    link.axis = direction_in(node, "axis");
    link.offset = three_in(node, "offset", any_length, three::Zero());
    link.mass = number_in(node, "mass", {0.0, 1e3, "kg", true});
    link.centre_of_mass = three_in(node, "centre_of_mass", any_length, three::Zero());
    read_inertia(node, &link);
    read_limits(node, &link);
    link.cover_hardening = number_in(node, "cover_hardening", {0.0, 1e6, "N·m/rad3"}, 0.0);
    link.damping = number_in(node, "damping", {0.0, 1e3, "N·m·s/rad"}, 0.0);
    if (!cover.absent()) {
      link.cover_stiffness = number_in(cover, "stiffness", {0.0, 1e6, "N·m/rad"}, 0.0);
      link.cover_rest = number_in(cover, "rest_angle", any_angle, 0.0);
    }
  }
  rig->gravity = three_in(physics, "gravity", {-1e3, 1e3, "m/s2"}, three{0.0, 0.0, -9.81});
  rig->tip = three_in(physics, "tip", any_length, three::Zero());
  rig->coupling = numbers_in(physics, "joint_coupling", n - 1, {0.0, 1e6, "N·m/rad"});
  const json_node servo = physics.member("servo");
  servo.expect_keys_if_present({"frequency", "damping_ratio"});
  rig->servo_frequency = number_in(servo, "frequency", {0.01, 1e4, "Hz"}, 15.0);
  rig->servo_damping = number_in(servo, "damping_ratio", {0.01, 100.0, ""}, 1.0);
}

void read_tendons(const json_node& finger, const json_node& physics, rig* rig) {
  const json_node described = finger.member("tendons"), list = physics.member("tendons");
  const std::size_t n = rig->joint_count(), m = described.size();
  if (!list.absent()) {
    list.expect_list(0, m, "tendons");
  }
  rig->tendons.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    const json_node node = list.element(i);
    node.expect_keys_if_present(
        {"hardening", "damping", "moment_arm_scale", "moment_arm_slope", "eccentricity", "phase"});
    tendon& tendon = rig->tendons[i];
    tendon.stiffness = number_in(described.element(i), "stiffness", {0.0, 1e9, "N/m", true});
    tendon.hardening = number_in(node, "hardening", {0.0, 1e12, "N/m2"}, 0.0);
    tendon.damping = number_in(node, "damping", {0.0, 1e6, "N·s/m"}, 0.0);
    const double scale = number_in(node, "moment_arm_scale", {0.1, 10.0, ""}, 1.0);
    const std::vector<double> mean = numbers_in(described.element(i), "moment_arms", n, any_length, false);
    const std::vector<double> slope = numbers_in(node, "moment_arm_slope", n, {-1.0, 1.0, "m/rad"});
    const std::vector<double> eccentricity = numbers_in(node, "eccentricity", n, {-1.0, 1.0, "m"});
    const std::vector<double> phase = numbers_in(node, "phase", n, any_angle);
    for (std::size_t j = 0; j < n; ++j) {
      tendon.arms.push_back({scale * mean[j], slope[j], eccentricity[j], phase[j]});
    }
  }
}

/* --- pushes, obstacle --------------------------------------------------------------------------------------------- */

constexpr std::size_t most_pushes = 100000;
constexpr range some_time = {0.0, 1e6, "s", true};

push read_push(const json_node& node, const rig& rig) {
  node.expect_keys({"start", "rise", "hold", "fall", "force", "direction", "frame", "link", "point"});
  push push;
  push.start = number_in(node, "start", {0.0, 1e9, "s"});
  push.rise = number_in(node, "rise", some_time);
  push.hold = number_in(node, "hold", {0.0, 1e6, "s"});
  push.fall = number_in(node, "fall", some_time);
  push.force = number_in(node, "force", {-1e4, 1e4, "N"});
  push.direction = direction_in(node, "direction");
  push.in_link_frame = choice_in(node, "frame", {"link", "base"}) == 0;
  push.link = index_in(node, "link", 1, rig.joint_count(), rig.joint_count()) - 1;
  push.point = three_in(node, "point", any_length, rig.tip);
  return push;
}

void read_contact(const json_node& physics, const json_node& pushes, rig* rig) {
  rig->contact_force = number_in(physics, "contact_force", {0.0, 1e4, "N"}, 0.05);
  const json_node node = physics.member("obstacle");
  if (!node.absent()) {
    node.expect_keys({"centre", "radius", "stiffness", "damping", "link", "point"});
    obstacle& sphere = rig->obstacle;
    sphere.present = true;
    sphere.centre = three_in(node, "centre", any_length, std::nullopt);
    sphere.radius = number_in(node, "radius", {0.0, 10.0, "m", true});
    sphere.stiffness = number_in(node, "stiffness", {0.0, 1e7, "N/m", true});
    sphere.damping = number_in(node, "damping", {0.0, 1e3, "s/m"}, 0.0);
    sphere.link = index_in(node, "link", 1, rig->joint_count(), rig->joint_count()) - 1;
    sphere.point = three_in(node, "point", any_length, rig->tip);
  }
  if (pushes.absent()) {
    return;
  }
  pushes.expect_list(0, most_pushes, "pushes");
  for (std::size_t k = 0; k < pushes.size(); ++k) {
    rig->pushes.push_back(read_push(pushes.element(k), *rig));
  }
}

/* --- motion, sensors ---------------------------------------------------------------------------------------------- */

constexpr std::size_t most_knots = 2000000;
constexpr double longest_delay = 0.05;  // s

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
  knots.position = numbers_in(node, "position", count, any_angle, false);
  knots.velocity = numbers_in(node, "velocity", count, {-1e4, 1e4, "rad/s"}, false);
  knots.acceleration = numbers_in(node, "acceleration", count, {-1e7, 1e7, "rad/s2"}, false);
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

struct sensor_fact {
  const char *name, *unit;
  bool per_tendon, has_play;
};
const sensor_fact sensor_facts[sensors::quantities] = {{"tendon_force", "N", true, false},
                                                       {"tendon_position", "m", true, true},
                                                       {"joint_position", "rad", false, false},
                                                       {"joint_velocity", "rad/s", false, false},
                                                       {"external_torque", "N·m", false, false}};

sensor read_sensor(const json_node& node, const sensor_fact& fact, std::size_t channels) {
  std::vector<std::string> keys = {"noise", "resolution", "gain", "offset", "delay"};
  if (fact.has_play) {
    keys.push_back("backlash");
  }
  node.expect_keys_if_present(keys);
  sensor sensor;
  sensor.noise = number_in(node, "noise", {0.0, 1e6, fact.unit}, 0.0);
  sensor.resolution = number_in(node, "resolution", {0.0, 1e6, fact.unit}, 0.0);
  sensor.delay = number_in(node, "delay", {0.0, longest_delay, "s"}, 0.0);
  sensor.backlash = number_in(node, "backlash", {0.0, 1.0, fact.unit}, 0.0);
  sensor.gain = read_channels(node, "gain", channels, {-1e3, 1e3, ""}, 1.0);
  sensor.offset = read_channels(node, "offset", channels, {-1e6, 1e6, fact.unit}, 0.0);
  return sensor;
}

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
  knots.position = numbers_in(pretension, "value", knots.time.size(), {0.0, 1e5, "N", true}, false);
  knots.velocity.assign(knots.time.size(), 0.0);
  knots.acceleration.assign(knots.time.size(), 0.0);
}

void read_sensors(const json_node& node, rig* rig) {
  std::vector<std::string> keys = {"rate"};
  for (const sensor_fact& fact : sensor_facts) {
    keys.push_back(fact.name);
  }
  node.expect_keys_if_present(keys);
  rig->sensors.rate = number_in(node, "rate", {1.0, 1e5, "Hz"}, 1000.0);
  for (std::size_t k = 0; k < sensors::quantities; ++k) {
    const sensor_fact& fact = sensor_facts[k];
    rig->sensors.of[k] =
        read_sensor(node.member(fact.name), fact, fact.per_tendon ? rig->tendon_count() : rig->joint_count());
  }
}

/* --- the whole file ----------------------------------------------------------------------------------------------- */

constexpr std::size_t largest_seed = 9007199254740992;  // 2^53: exact as a double

/* The finger description must be one: the product's own reader judges it, its numbers are then taken as they are. */
void check_finger(const json_node& finger) {
  finger.expect_object();
  const std::string text = finger.value().dump();
  void* image = nullptr;
  std::size_t size = 0;
  char message[512];
  const tendonfmu_status status =
      tendonfmu_image_from_json(text.data(), text.size(), &image, &size, message, sizeof message);
  tendonfmu_free_image(image);
  if (status != TENDONFMU_OK) {
    throw description_error("finger." + std::string(message));
  }

  const json_node extensions = finger.member("extensions");
  if (!extensions.absent() && extensions.size() > 0) {
    extensions.refuse("none here: what the simulated finger has beyond the description is under `physics`");
  }
  const json_node tendons = finger.member("tendons");
  for (std::size_t i = 0; i < tendons.size(); ++i) {
    const json_node loop = tendons.element(i).member("bidirectional");
    if (!loop.absent() && loop.boolean()) {
      loop.refuse("false: simulated tendons pull only");
    }
  }
}

json_node physics_of(const json_node& document) {
  const json_node physics = document.member("physics");
  physics.expect_keys({"gravity", "links", "tip", "joint_coupling", "tendons", "servo", "friction", "wrist", "obstacle",
                       "contact_force"});
  return physics;
}

}  // namespace

rig read_rig(const char* text, std::size_t size) {
  const json parsed = parse_document(text, size);
  const json_node document(parsed);
  document.expect_keys({"format", "name", "version", "seed", "finger", "physics", "sensors", "motion", "pushes",
                        "settle", "integration", "recording"});
  if (document.member("format").text() != "tendonfmu-rig-1") {
    document.member("format").refuse("\"tendonfmu-rig-1\"");
  }
  rig rig;
  rig.name = document.member("name").text();
  rig.seed = index_in(document, "seed", 0, largest_seed, 0);
  const json_node finger = document.member("finger");
  check_finger(finger);
  const json_node physics = physics_of(document);
  read_links(finger, physics, &rig);
  read_tendons(finger, physics, &rig);
  read_friction(finger, physics, &rig);
  read_contact(physics, document.member("pushes"), &rig);
  read_motion(document.member("motion"), &rig);
  read_sensors(document.member("sensors"), &rig);
  rig.settle = number_in(document, "settle", {0.0, 1e3, "s"}, 2.0);
  const json_node integration = document.member("integration");
  integration.expect_keys_if_present({"relative_tolerance"});
  rig.relative_tolerance = number_in(integration, "relative_tolerance", {1e-10, 1e-2, ""}, 1e-6);
  check_rig(document, &rig);
  return rig;
}

}  // namespace tendonfmu::plant
