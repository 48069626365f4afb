#include "shape_reader.h"

#include <algorithm>
#include <string>

#include "description_error.h"
#include "description_keys.h"
#include "extension_reader.h"

namespace tendonfmu {
namespace {

constexpr const char* format_name = "tendonfmu-finger-1";
constexpr std::size_t max_name_bytes = 200;

const std::vector<std::string> sides = {"positive", "negative"};

std::vector<std::string> with(std::vector<std::string> keys, const std::vector<std::string>& more) {
  keys.insert(keys.end(), more.begin(), more.end());
  return keys;
}

/* of a law, and of an edge, which may be working points in its place */
std::vector<std::string> any_law_keys() {
  return with(law_keys(), sides);
}

std::vector<std::string> edge_keys() {
  return with(any_law_keys(), {"angles", "laws"});
}

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
  expect_none(law, law_keys(), "positive and negative");
  positive.expect_keys(law_keys());
  negative.expect_keys(law_keys());
  return LAW_ASYMMETRIC;
}

law_kind read_law(const json_node& law) {
  return law.absent() ? LAW_ABSENT : kind_of_law(law.expect_keys(any_law_keys()));
}

void read_working_points(const json_node& edge, std::vector<std::uint32_t>& words) {
  expect_none(edge, any_law_keys(), "angles and laws");
  const json_node angles = edge.member("angles"), laws = edge.member("laws");
  angles.expect_list(1, MODEL_MAX_POINTS, "angles in rad, strictly increasing");
  laws.expect_list(angles.size(), angles.size(), "laws, one per angle");
  words.push_back(static_cast<std::uint32_t>(angles.size()) | MODEL_EDGE_HAS_ANGLES);
  for (std::size_t k = 0; k < angles.size(); ++k) {
    words.push_back(kind_of_law(laws.element(k).expect_keys(any_law_keys())));
  }
}

void read_edge(const json_node& edge, std::vector<std::uint32_t>& words) {
  if (edge.absent()) {
    words.push_back(0);
    return;
  }
  edge.expect_keys(edge_keys());
  if (edge.member("angles").absent() && edge.member("laws").absent()) {
    words.push_back(1);
    words.push_back(kind_of_law(edge));
    return;
  }
  read_working_points(edge, words);
}

/* --- numbers of an object ----------------------------------------------------------------------------------------- */

/* the lists of an object that have one number per joint: those that are there, or must be, have so many */
void check_lists(const json_node& parent, const std::string& object, std::uint32_t joints) {
  for (const number_key& number : numbers_of(object)) {
    const json_node list = parent.member(number.key);
    if (number.per_joint && (number.required || !list.absent())) {
      list.expect_list(joints, joints, "numbers in " + std::string(number.unit) + ", one per joint");
    }
  }
}

/* the option bits of the numbers that are there */
std::uint32_t given_options(const json_node& parent, const std::string& object) {
  std::uint32_t options = 0;
  for (const number_key& number : numbers_of(object)) {
    options |= parent.member(number.key).absent() ? 0u : number.option;
  }
  return options;
}

/* --- joints and tendons ------------------------------------------------------------------------------------------- */

std::uint32_t read_joint(const json_node& joint) {
  joint.expect_keys(keys_of("joints"));
  check_optional_name(joint);
  const json_node cover = joint.member("cover");
  cover.expect_keys_if_present(keys_of("joints.cover"));
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
  tendon.expect_keys(keys_of("tendons"));
  check_optional_name(tendon);
  const json_node bidirectional = tendon.member("bidirectional");
  const json_node pulleys = tendon.member("pulley_friction"), edges = tendon.member("edge_friction");
  words.push_back(!bidirectional.absent() && bidirectional.boolean());
  check_lists(tendon, "tendons", joints);
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

/* an object that may be left out: the option bit that says it is there, or 0 */
std::uint32_t read_object(const json_node& object, const std::string& name, std::uint32_t joints,
                          std::uint32_t option) {
  if (object.absent()) {
    return 0u;
  }
  object.expect_keys(keys_of(name));
  check_lists(object, name, joints);
  return option;
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
  check_lists(bias, "bias", joints);
  return given_options(bias, "bias") |
         (word_of(bias.member("forgetting"), words_of("bias.forgetting")) ? unsigned{MODEL_FORGETS_BY_ABSORPTION} : 0u);
}

/* bands, and what else the method needs or does not take */
std::uint32_t read_method(const json_node& contact, std::uint32_t joints) {
  if (word_of(contact.member("method"), words_of("contact.method")) == 0) {
    expect_none(contact, {"bands", "watches_motors"}, "contact.method \"paper\"; it belongs to \"bands\"");
    return 0u;
  }
  const json_node bands = contact.member("bands"), motors = contact.member("watches_motors");
  bands.expect_list(MODEL_MAX_BANDS, MODEL_MAX_BANDS, "objects with the numbers of each band");
  for (std::size_t k = 0; k < MODEL_MAX_BANDS; ++k) {
    check_lists(bands.element(k).expect_keys(keys_of("contact.bands")), "contact.bands", joints);
  }
  return unsigned{MODEL_DETECTS_BY_BANDS} |
         (!motors.absent() && motors.boolean() ? unsigned{MODEL_WATCHES_MOTORS} : 0u);
}

std::uint32_t read_contact_options(const json_node& contact, std::uint32_t joints) {
  contact.expect_keys(keys_of("contact"));
  check_lists(contact, "contact", joints);
  return read_method(contact, joints) | given_options(contact, "contact");
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
    const json_node link = links.element(j).expect_keys(keys_of("links"));
    link.member("axis").expect_list(3, 3, "numbers, the direction of the joint's axis");
    if (!link.member("offset").absent()) {
      link.member("offset").expect_list(3, 3, "numbers in m");
    }
  }
  tip.expect_list(3, 3, "numbers in m, the fingertip in the last link's frame");
  return MODEL_HAS_LINKS;
}

/* Metadata: no output depends on it. */
void check_estimated(const json_node& estimated) {
  if (estimated.absent()) {
    return;
  }
  estimated.expect_object();
  for (const auto& entry : estimated.value().items()) {
    const json_node known = estimated.member(entry.key());
    known.expect_list(2, 2, "numbers: the value and its standard error");
    const json &value = known.value()[0], &error = known.value()[1];
    if (!value.is_number() || !error.is_number() || !(error.get<double>() >= 0.0 && error.get<double>() <= 1e9)) {
      known.refuse("a value and its standard error, 0 to 1e9");
    }
  }
}

void refuse_dropped(const json_node& document) {
  for (const char* key :
       {"position_filter", "velocity_threshold.hysteresis", "bias.entry_load", "bias.start_share", "contact.innovation",
        "contact.friction_bound", "contact.uncertainty", "contact.uncertainty_level", "contact.release_ratio",
        "contact.hold_time", "contact.release_time", "contact.drift", "contact.rest"}) {
    if (!document.find(key).absent()) {
      throw description_error(std::string(key) + ": no longer a key; leave it out, or calibrate again");
    }
  }
}

void check_top(const json_node& document) {
  refuse_dropped(document);
  document.expect_keys(keys_of(""));
  const json_node format = document.member("format");
  if (format.absent() || format.value() != format_name) {
    format.refuse("\"" + std::string(format_name) + "\"");
  }
  check_name(document.member("name"));
  check_estimated(document.member("estimated"));
  for (const std::string name : {"velocity_threshold", "bias"}) {
    document.member(name).expect_keys_if_present(keys_of(name));
  }
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
  for (std::size_t i = 0; i < tendons.size(); ++i) {
    finger.shape.options |= given_options(tendons.element(i), "tendons");
  }
  finger.shape.options |=
      read_bias_options(document.member("bias"), finger.shape.joints) |
      read_contact_options(document.member("contact"), finger.shape.joints) |
      given_options(document.member("velocity_threshold"), "velocity_threshold") |
      read_links(document, finger.shape.joints) |
      read_object(document.member("sensor_fault"), "sensor_fault", finger.shape.joints, MODEL_HAS_SENSOR_FAULT);
  read_extensions(document.member("extensions"), finger.shape.joints, finger.shape.tendons, finger.extensions);
  finger.shape.extension_count = static_cast<std::uint32_t>(finger.extensions.size() / MODEL_EXTENSION_WORDS);
  finger.shape.word_count = static_cast<std::uint32_t>(finger.words.size());
  finger.shape.words = finger.words.data();
  finger.shape.extensions = finger.extensions.data();
  finger.shape.parameter_count = model_count_parameters(&finger.shape);
  return finger;
}

}  // namespace tendonfmu
