#include "rig_reader.h"

#include <memory>

#include "description_error.h"
#include "json_document.h"
#include "json_node.h"
#include "rig_parts.h"
#include "rig_values.h"
#include "tendonfmu_description.h"

namespace tendonfmu::plant {
namespace {

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
