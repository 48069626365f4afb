#include "shape_reader.h"

#include <algorithm>
#include <string>

#include "description_error.h"
#include "extension_reader.h"

namespace tendonfmu {
namespace {

constexpr const char* format_name = "tendonfmu-finger-1";
constexpr std::size_t max_name_bytes = 200;

const std::vector<std::string> side_keys = {"static", "coulomb", "stribeck_velocity", "viscous"};
const std::vector<std::string> law_keys = {"static", "coulomb", "stribeck_velocity", "viscous", "positive", "negative"};
const std::vector<std::string> edge_keys = {"static", "coulomb", "stribeck_velocity", "viscous", "positive", "negative",
                                            "angles", "laws"};

/* names become file names and XML attributes */
void check_name(const json_node& node) {
  const std::string name = node.text();
  bool plain = !name.empty() && name.size() <= max_name_bytes;
  for (const char c : name) {
    plain = plain && static_cast<unsigned char>(c) >= 0x20 && c != 0x7f;
  }
  if (!plain) {
    node.refuse("a name of 1 to " + std::to_string(max_name_bytes) + " bytes without control characters");
  }
}

void check_optional_name(const json_node& parent) {
  const json_node name = parent.member("name");
  if (!name.absent()) {
    check_name(name);
  }
}

/* those that are there must not be: `other` says why */
void expect_none(const json_node& parent, const std::vector<std::string>& keys, const std::string& other) {
  for (const std::string& key : keys) {
    if (!parent.member(key).absent()) {
      throw description_error(parent.member(key).path() + ": not allowed beside " + other);
    }
  }
}

/* --- laws --------------------------------------------------------------------------------------------------------- */

/* of an object whose keys are known */
law_kind kind_of_law(const json_node& law) {
  const json_node positive = law.member("positive"), negative = law.member("negative");
  if (positive.absent() && negative.absent()) {
    return LAW_SYMMETRIC;
  }
  expect_none(law, side_keys, "positive and negative");
  positive.expect_keys(side_keys);
  negative.expect_keys(side_keys);
  return LAW_ASYMMETRIC;
}

law_kind read_law(const json_node& law) {
  return law.absent() ? LAW_ABSENT : kind_of_law(law.expect_keys(law_keys));
}

void read_working_points(const json_node& edge, std::vector<std::uint32_t>& words) {
  expect_none(edge, law_keys, "angles and laws");
  const json_node angles = edge.member("angles"), laws = edge.member("laws");
  angles.expect_list(1, MODEL_MAX_POINTS, "angles in rad, strictly increasing");
  laws.expect_list(angles.size(), angles.size(), "laws, one per angle");
  words.push_back(static_cast<std::uint32_t>(angles.size()) | MODEL_EDGE_HAS_ANGLES);
  for (std::size_t k = 0; k < angles.size(); ++k) {
    words.push_back(kind_of_law(laws.element(k).expect_keys(law_keys)));
  }
}

void read_edge(const json_node& edge, std::vector<std::uint32_t>& words) {
  if (edge.absent()) {
    words.push_back(0);
    return;
  }
  edge.expect_keys(edge_keys);
  if (edge.member("angles").absent() && edge.member("laws").absent()) {
    words.push_back(1);
    words.push_back(kind_of_law(edge));
    return;
  }
  read_working_points(edge, words);
}

/* --- joints and tendons ------------------------------------------------------------------------------------------- */

std::uint32_t read_joint(const json_node& joint) {
  joint.expect_keys({"name", "cover", "friction", "load_friction"});
  check_optional_name(joint);
  const json_node cover = joint.member("cover");
  if (!cover.absent()) {
    cover.expect_keys({"stiffness", "rest_angle"});
  }
  return (cover.absent() ? 0u : 1u) | static_cast<std::uint32_t>(read_law(joint.member("friction"))) << 1 |
         static_cast<std::uint32_t>(read_law(joint.member("load_friction"))) << 3;
}

/* friction lists may be left out or short */
void check_friction_list(const json_node& list, std::uint32_t joints) {
  if (!list.absent()) {
    list.expect_list(0, joints, "laws or nulls, one per joint");
  }
}

void read_tendon(const json_node& tendon, std::uint32_t joints, std::vector<std::uint32_t>& words) {
  tendon.expect_keys({"name", "stiffness", "moment_arms", "pulley_friction", "edge_friction", "bidirectional"});
  check_optional_name(tendon);
  const json_node bidirectional = tendon.member("bidirectional");
  const json_node pulleys = tendon.member("pulley_friction"), edges = tendon.member("edge_friction");
  words.push_back(!bidirectional.absent() && bidirectional.boolean());
  tendon.member("moment_arms").expect_list(joints, joints, "numbers in m, one per joint");
  check_friction_list(pulleys, joints);
  check_friction_list(edges, joints);
  const json_node last = pulleys.element(joints - 1);
  if (!last.absent()) {
    last.refuse("null, since no joint comes after the last pulley");
  }
  for (std::uint32_t j = 0; j < joints; ++j) {
    words.push_back(read_law(pulleys.element(j)));
  }
  for (std::uint32_t j = 0; j < joints; ++j) {
    read_edge(edges.element(j), words);
  }
}

/* --- the finger as a whole ---------------------------------------------------------------------------------------- */

void check_settings(const json_node& document, const char* name, const std::vector<std::string>& keys) {
  const json_node settings = document.member(name);
  if (!settings.absent()) {
    settings.expect_keys(keys);
  }
}

/* `bit` where any of the keys is there */
std::uint32_t given(const json_node& parent, const std::vector<std::string>& keys, unsigned bit) {
  for (const std::string& key : keys) {
    if (!parent.member(key).absent()) {
      return bit;
    }
  }
  return 0u;
}

/* position of a word among those allowed; the first one where it is left out */
std::size_t word_of(const json_node& node, const std::vector<std::string>& words) {
  std::string list;
  for (std::size_t i = 0; i < words.size(); ++i) {
    list += (list.empty() ? "\"" : ", \"") + words[i] + "\"";
    if (node.value() == words[i]) {
      return i;
    }
  }
  if (!node.absent()) {
    node.refuse("one of " + list);
  }
  return 0;
}

std::uint32_t read_bias_options(const json_node& bias, std::uint32_t joints) {
  const json_node torque = bias.member("initial_torque");
  if (!torque.absent()) {
    torque.expect_list(joints, joints, "numbers in N.m, one per joint");
  }
  const json_node entry_load = bias.member("entry_load");
  return given(bias, {"initial_variance"}, MODEL_HAS_INITIAL_VARIANCE) |
         given(bias, {"initial_torque"}, MODEL_HAS_INITIAL_TORQUE) | given(bias, {"noise_time"}, MODEL_HAS_NOISE_TIME) |
         given(bias, {"start_share"}, MODEL_HAS_START_SHARE) |
         (word_of(bias.member("forgetting"), {"time", "absorption"}) ? unsigned{MODEL_FORGETS_BY_ABSORPTION} : 0u) |
         (!entry_load.absent() && entry_load.boolean() ? unsigned{MODEL_REMEMBERS_ENTRY_LOAD} : 0u);
}

/* a list that may be left out */
void check_optional_list(const json_node& list, std::uint32_t size, const std::string& meaning) {
  if (!list.absent()) {
    list.expect_list(size, size, meaning);
  }
}

/* the thresholds of the residual, or of the innovation */
void check_thresholds(const json_node& parent, std::uint32_t joints) {
  parent.member("threshold").expect_list(joints, joints, "numbers in N.m, one per joint");
  check_optional_list(parent.member("threshold_per_force"), joints, "numbers in N.m per N, one per joint");
}

std::uint32_t read_method(const json_node& contact, std::uint32_t joints) {
  const std::size_t method = word_of(contact.member("method"), {"threshold", "innovation", "cusum"});
  const json_node innovation = contact.member("innovation");
  if (method == 0) {
    if (!innovation.absent()) {
      throw description_error(
          innovation.path() +
          ": not allowed with contact.method \"threshold\"; it belongs to \"innovation\" and \"cusum\"");
    }
    return 0u;
  }
  if (innovation.absent()) {
    innovation.refuse("an object with time and threshold, which contact.method needs");
  }
  innovation.expect_keys({"time", "threshold", "threshold_per_force", "evidence_time"});
  check_thresholds(innovation, joints);
  if (method == 1) {
    expect_none(innovation, {"evidence_time"}, "contact.method \"innovation\"; it belongs to \"cusum\"");
    return MODEL_DETECTS_BY_INNOVATION;
  }
  return unsigned{MODEL_DETECTS_BY_INNOVATION} | unsigned{MODEL_DETECTS_BY_CUSUM};
}

std::uint32_t read_uncertainty(const json_node& contact, std::uint32_t joints, std::uint32_t tendons) {
  const json_node uncertainty = contact.member("uncertainty");
  std::uint32_t most = 0;
  if (uncertainty.absent()) {
    const json_node level = contact.member("uncertainty_level");
    if (!level.absent()) {
      throw description_error(level.path() + ": not allowed without contact.uncertainty");
    }
    return 0u;
  }
  uncertainty.expect_list(joints, joints, "lists of directions, one per joint");
  for (std::uint32_t j = 0; j < joints; ++j) {
    const json_node directions = uncertainty.element(j);
    if (directions.absent()) {
      continue;
    }
    directions.expect_list(0, MODEL_MAX_DIRECTIONS, "directions");
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const std::uint32_t shares = tendons + MODEL_DIRECTION_SHARES;
      directions.element(d).expect_list(shares, shares,
                                        "relative errors: of the tendons, joint friction, load friction, cover");
    }
    most = std::max(most, static_cast<std::uint32_t>(directions.size()));
  }
  return unsigned{MODEL_HAS_UNCERTAINTY} | most << 10;
}

std::uint32_t read_rest(const json_node& contact, std::uint32_t joints) {
  const json_node rest = contact.member("rest");
  if (rest.absent()) {
    return 0u;
  }
  rest.expect_keys({"travel", "settle_time", "averaging_time", "threshold", "threshold_per_force", "creep",
                    "fall_share", "innovation"});
  check_thresholds(rest, joints);
  check_optional_list(rest.member("creep"), joints, "numbers in N.m, one per joint");
  const json_node innovation = rest.member("innovation");
  if (innovation.absent()) {
    return MODEL_HAS_REST;
  }
  innovation.expect_keys({"time", "threshold"});
  innovation.member("threshold").expect_list(joints, joints, "numbers in N.m, one per joint");
  return unsigned{MODEL_HAS_REST} | unsigned{MODEL_HAS_REST_INNOVATION};
}

std::uint32_t read_drift(const json_node& contact, std::uint32_t joints) {
  const json_node drift = contact.member("drift");
  if (drift.absent()) {
    return 0u;
  }
  drift.expect_keys({"quick_time", "slow_time", "threshold", "threshold_per_force"});
  check_thresholds(drift, joints);
  return MODEL_HAS_DRIFT;
}

std::uint32_t read_friction_bound(const json_node& contact) {
  const json_node bound = contact.member("friction_bound");
  if (bound.absent()) {
    return 0u;
  }
  bound.expect_keys({"stuck_share", "stuck_time", "stuck_presliding", "jump_share", "jump_time"});
  const json_node presliding = bound.member("stuck_presliding");
  const bool counts = !presliding.absent() && presliding.boolean();
  return unsigned{MODEL_HAS_FRICTION_BOUND} | (counts ? unsigned{MODEL_BOUNDS_PRESLIDING} : 0u);
}

std::uint32_t read_contact_options(const json_node& contact, std::uint32_t joints, std::uint32_t tendons) {
  contact.expect_keys({"threshold", "threshold_per_force", "method", "innovation", "friction_bound", "uncertainty",
                       "uncertainty_level", "deviation", "deviation_per_force", "release_ratio", "hold_time",
                       "release_time", "drift", "rest"});
  check_thresholds(contact, joints);
  check_optional_list(contact.member("deviation"), joints, "numbers in N.m, one per joint");
  check_optional_list(contact.member("deviation_per_force"), joints, "numbers in N.m per N, one per joint");
  return read_method(contact, joints) | read_uncertainty(contact, joints, tendons) | read_friction_bound(contact) |
         given(contact, {"deviation", "deviation_per_force"}, MODEL_HAS_DEVIATION) |
         given(contact, {"release_ratio", "hold_time"}, MODEL_HAS_RELEASE) |
         given(contact, {"release_time"}, MODEL_HAS_RELEASE_TIME) | read_drift(contact, joints) |
         read_rest(contact, joints);
}

std::uint32_t read_position_filter(const json_node& filter, std::uint32_t joints) {
  if (filter.absent()) {
    return 0u;
  }
  filter.expect_keys({"noise", "jerk_density"});
  filter.member("noise").expect_list(joints, joints, "numbers in rad, one per joint");
  return MODEL_HAS_POSITION_FILTER;
}

std::uint32_t read_links(const json_node& document, std::uint32_t joints) {
  const json_node links = document.member("links"), tip = document.member("tip");
  if (links.absent()) {
    if (!tip.absent()) {
      throw description_error(tip.path() + ": not allowed without links");
    }
    return 0u;
  }
  links.expect_list(joints, joints, "links, one per joint");
  for (std::uint32_t j = 0; j < joints; ++j) {
    const json_node link = links.element(j).expect_keys({"axis", "offset"});
    link.member("axis").expect_list(3, 3, "numbers, the direction of the joint's axis");
    check_optional_list(link.member("offset"), 3, "numbers in m");
  }
  tip.expect_list(3, 3, "numbers in m, the fingertip in the last link's frame");
  return MODEL_HAS_LINKS;
}

std::uint32_t read_sensor_fault(const json_node& fault) {
  if (fault.absent()) {
    return 0u;
  }
  fault.expect_keys({"hold_time", "force_resolution", "position_resolution", "jump_margin", "recovery_time"});
  return MODEL_HAS_SENSOR_FAULT;
}

void check_top(const json_node& document) {
  document.expect_keys({"format", "name", "joints", "tendons", "velocity_threshold", "velocity_filter_cutoff",
                        "position_filter", "bias", "contact", "extensions", "links", "tip", "sensor_fault"});
  const json_node format = document.member("format");
  if (format.absent() || format.value() != format_name) {
    format.refuse("\"" + std::string(format_name) + "\"");
  }
  check_name(document.member("name"));
  check_settings(document, "velocity_threshold", {"tendon", "joint", "hysteresis"});
  check_settings(document, "bias",
                 {"drift_variance", "noise_std", "noise_std_per_force", "initial_variance", "forget_rate",
                  "initial_torque", "noise_time", "start_share", "forgetting", "entry_load"});
}

}  // namespace

finger_shape read_shape(const json_node& document) {
  finger_shape finger;
  check_top(document);
  const json_node joints = document.member("joints"), tendons = document.member("tendons");
  joints.expect_list(1, MODEL_MAX_JOINTS, "joints");
  tendons.expect_list(1, MODEL_MAX_TENDONS, "tendons");
  finger.shape.joints = static_cast<std::uint32_t>(joints.size());
  finger.shape.tendons = static_cast<std::uint32_t>(tendons.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    finger.words.push_back(read_joint(joints.element(j)));
  }
  for (std::size_t i = 0; i < tendons.size(); ++i) {
    read_tendon(tendons.element(i), finger.shape.joints, finger.words);
  }
  finger.shape.options = read_bias_options(document.member("bias"), finger.shape.joints) |
                         read_contact_options(document.member("contact"), finger.shape.joints, finger.shape.tendons) |
                         given(document.member("velocity_threshold"), {"hysteresis"}, MODEL_HAS_HYSTERESIS) |
                         read_position_filter(document.member("position_filter"), finger.shape.joints) |
                         read_links(document, finger.shape.joints) | read_sensor_fault(document.member("sensor_fault"));
  read_extensions(document.member("extensions"), finger.shape.joints, finger.shape.tendons, finger.extensions);
  finger.shape.extension_count = static_cast<std::uint32_t>(finger.extensions.size() / MODEL_EXTENSION_WORDS);
  finger.shape.word_count = static_cast<std::uint32_t>(finger.words.size());
  finger.shape.words = finger.words.data();
  finger.shape.extensions = finger.extensions.data();
  finger.shape.parameter_count = model_count_parameters(&finger.shape);
  return finger;
}

}  // namespace tendonfmu
