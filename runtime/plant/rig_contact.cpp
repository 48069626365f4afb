#include "rig_parts.h"
#include "rig_values.h"

namespace tendonfmu::plant {
namespace {

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

}  // namespace

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

}  // namespace tendonfmu::plant
