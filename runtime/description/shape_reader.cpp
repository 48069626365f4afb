#include "shape_reader.h"

#include <cstring>
#include <string>

#include "description_error.h"

namespace tendonfmu {
namespace {

constexpr const char* format_name = "tendonfmu-finger-1";
constexpr std::size_t max_name_bytes = 200;

const std::vector<std::string> side_keys = {"static", "coulomb", "stribeck_velocity", "viscous"};
const std::vector<std::string> law_keys = {"static", "coulomb", "stribeck_velocity", "viscous", "positive", "negative"};
const std::vector<std::string> edge_keys = {"static", "coulomb", "stribeck_velocity", "viscous", "positive", "negative",
                                            "angles", "laws"};

/* Effects of docs/model.md that a description may one day name; the core's table says which ones it has. */
const char* const planned_effects[] = {"viscous_friction",
                                       "stribeck",
                                       "asymmetric_friction",
                                       "edge_friction",
                                       "pulley_friction",
                                       "joint_friction",
                                       "joint_load_friction",
                                       "preload_friction",
                                       "load_friction",
                                       "cover_stiffness",
                                       "gravity",
                                       "inertia",
                                       "presliding",
                                       "friction_drift",
                                       "force_gain",
                                       "force_offset",
                                       "time_delay",
                                       "moment_arm",
                                       "moment_arm_variation",
                                       "pulley_eccentricity",
                                       "tendon_nonlinearity",
                                       "joint_coupling",
                                       "backlash",
                                       "contact",
                                       "unknown"};

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

std::uint32_t read_bias_options(const json_node& bias, std::uint32_t joints) {
  const json_node torque = bias.member("initial_torque");
  if (!torque.absent()) {
    torque.expect_list(joints, joints, "numbers in N.m, one per joint");
  }
  return (bias.member("initial_variance").absent() ? 0u : unsigned{MODEL_HAS_INITIAL_VARIANCE}) |
         (torque.absent() ? 0u : unsigned{MODEL_HAS_INITIAL_TORQUE}) |
         (bias.member("noise_time").absent() ? 0u : unsigned{MODEL_HAS_NOISE_TIME});
}

void check_contact(const json_node& contact, std::uint32_t joints) {
  contact.expect_keys({"threshold", "threshold_per_force"});
  contact.member("threshold").expect_list(joints, joints, "numbers in N.m, one per joint");
  const json_node per_force = contact.member("threshold_per_force");
  if (!per_force.absent()) {
    per_force.expect_list(joints, joints, "numbers in N.m per N, one per joint");
  }
}

const effect_type* read_effect_name(const json_node& node) {
  const std::string name = node.text();
  std::string known;
  for (std::size_t i = 0; effect_at(i); ++i) {
    if (name == effect_at(i)->name) {
      return effect_at(i);
    }
    known += (known.empty() ? "" : ", ") + std::string(effect_at(i)->name);
  }
  for (const char* planned : planned_effects) {
    if (name == planned) {
      throw description_error(node.path() + " = \"" + name +
                              "\": an effect that this version has no extension for; expected one of " + known);
    }
  }
  node.refuse("one of " + known);
}

std::uint32_t read_effect_joint(const json_node& node, std::uint32_t joints) {
  const bool whole = node.value().is_number() && node.value().get<double>() >= 1.0 &&
                     node.value().get<double>() <= joints &&
                     node.value().get<double>() == static_cast<std::uint32_t>(node.value().get<double>());
  if (!whole) {
    node.refuse("a joint from 1 to " + std::to_string(joints));
  }
  return node.value().get<std::uint32_t>();
}

void read_extension(const json_node& extension, std::uint32_t joints, std::vector<std::uint32_t>& table) {
  const effect_type* effect = read_effect_name(extension.expect_object().member("effect"));
  std::vector<std::string> keys = {"effect", "joint"};
  for (std::uint32_t i = 0; i < effect->parameter_count; ++i) {
    keys.emplace_back(effect->parameters[i].name);
  }
  extension.expect_keys(keys);
  table.insert(table.end(), {effect->id, read_effect_joint(extension.member("joint"), joints), 0u, 0u});
}

void read_extensions(const json_node& list, finger_shape& finger) {
  if (list.absent()) {
    return;
  }
  list.expect_list(0, MODEL_MAX_EXTENSIONS, "extensions");
  for (std::size_t i = 0; i < list.size(); ++i) {
    read_extension(list.element(i), finger.shape.joints, finger.extensions);
  }
  finger.shape.extension_count = static_cast<std::uint32_t>(list.size());
}

void check_top(const json_node& document) {
  document.expect_keys({"format", "name", "joints", "tendons", "velocity_threshold", "velocity_filter_cutoff", "bias",
                        "contact", "extensions"});
  const json_node format = document.member("format");
  if (format.absent() || format.value() != format_name) {
    format.refuse("\"" + std::string(format_name) + "\"");
  }
  check_name(document.member("name"));
  check_settings(document, "velocity_threshold", {"tendon", "joint"});
  check_settings(document, "bias",
                 {"drift_variance", "noise_std", "noise_std_per_force", "initial_variance", "forget_rate",
                  "initial_torque", "noise_time"});
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
  finger.shape.options = read_bias_options(document.member("bias"), finger.shape.joints);
  check_contact(document.member("contact"), finger.shape.joints);
  read_extensions(document.member("extensions"), finger);
  finger.shape.word_count = static_cast<std::uint32_t>(finger.words.size());
  finger.shape.words = finger.words.data();
  finger.shape.extensions = finger.extensions.data();
  finger.shape.parameter_count = model_count_parameters(&finger.shape);
  return finger;
}

}  // namespace tendonfmu
