#include <cmath>

#include "rig_parts.h"
#include "rig_values.h"

namespace tendonfmu::plant {
namespace {

constexpr double pi_limit = 3.14159;  // rad: a joint without limits still cannot turn round

void read_inertia(const json_node& node, link* link) {
  link->inertia = three_in(node, "inertia", {0.0, 1e3, "kg m2", true}, std::nullopt);
  const three& i = link->inertia;
  // no body has a moment of inertia larger than the sum of the others
  const double slack = 1e-9 * (i[0] + i[1] + i[2]);
  if (i[0] > i[1] + i[2] + slack || i[1] > i[0] + i[2] + slack || i[2] > i[0] + i[1] + slack) {
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

}  // namespace

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
    link.offset = three_in(node, "offset", any_length, three{});
    link.mass = number_in(node, "mass", {0.0, 1e3, "kg", true});
    link.centre_of_mass = three_in(node, "centre_of_mass", any_length, three{});
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
  rig->tip = three_in(physics, "tip", any_length, three{});
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

}  // namespace tendonfmu::plant
