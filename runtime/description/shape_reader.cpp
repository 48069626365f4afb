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

/* of a law, and of an edge, which may be working points in its place */
std::vector<std::string> any_law_keys(const std::vector<std::string>& more = {}) {
  std::vector<std::string> keys = law_keys();
  keys.insert(keys.end(), sides.begin(), sides.end());
  keys.insert(keys.end(), more.begin(), more.end());
  return keys;
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
  edge.expect_keys(any_law_keys({"angles", "laws"}));
  if (edge.member("angles").absent() && edge.member("laws").absent()) {
    words.push_back(1);
    words.push_back(kind_of_law(edge));
    return;
  }
  read_working_points(edge, words);
}

/* --- objects, by the table of keys -------------------------------------------------------------------------------- */

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

void read_object(const json_node& node, const std::string& object, model_shape& shape);

void read_list(const json_node& list, const std::string& object, const key_fact& fact, model_shape& shape) {
  list.expect_list(fact.most ? fact.least : shape.joints, fact.most ? fact.most : shape.joints, fact.holds);
  for (std::size_t k = 0; k < list.size(); ++k) {
    read_object(list.element(k), object, shape);
  }
}

/* what one key holds, and its option bit; laws and what else has a rule of its own are left to their readers */
void read_key(const json_node& node, const std::string& path, const key_fact& fact, model_shape& shape) {
  if (node.absent() && !fact.required) {
    return;
  }
  bool is_set = true;
  switch (fact.kind) {
    case key_kind::per_joint: node.expect_list(shape.joints, shape.joints, fact.holds); break;
    case key_kind::vector: node.expect_list(3, 3, fact.holds); break;
    case key_kind::format:
      if (node.value() != format_name) {
        node.refuse("\"" + std::string(format_name) + "\"");
      }
      break;
    case key_kind::object: read_object(node, path, shape); break;
    case key_kind::list: read_list(node, path, fact, shape); break;
    case key_kind::name: check_name(node); break;
    case key_kind::flag: is_set = node.boolean(); break;
    case key_kind::word: is_set = word_of(node, fact.words) > 0; break;
    default: break;
  }
  shape.options |= is_set ? fact.option : 0u;
}

void read_object(const json_node& node, const std::string& object, model_shape& shape) {
  std::vector<std::string> keys;
  for (const key_fact& fact : key_facts()) {
    if (object == fact.object) {
      keys.emplace_back(fact.key);
    }
  }
  node.expect_keys(keys);
  for (const key_fact& fact : key_facts()) {
    if (object == fact.object) {
      read_key(node.member(fact.key), object.empty() ? fact.key : object + "." + fact.key, fact, shape);
    }
  }
}

/* --- which laws joints and tendons have --------------------------------------------------------------------------- */

std::uint32_t word_of_joint(const json_node& joint) {
  return (joint.member("cover").absent() ? 0u : 1u) |
         static_cast<std::uint32_t>(read_law(joint.member("friction"))) << 1 |
         static_cast<std::uint32_t>(read_law(joint.member("load_friction"))) << 3;
}

/* friction lists may be left out or short */
json_node friction_list(const json_node& tendon, const char* key, std::uint32_t joints) {
  const json_node list = tendon.member(key);
  return list.absent() ? list : list.expect_list(0, joints, "laws or nulls, one per joint");
}

void add_words_of_tendon(const json_node& tendon, std::uint32_t joints, std::vector<std::uint32_t>& words) {
  const json_node bidirectional = tendon.member("bidirectional");
  const json_node pulleys = friction_list(tendon, "pulley_friction", joints);
  const json_node edges = friction_list(tendon, "edge_friction", joints);
  words.push_back(!bidirectional.absent() && bidirectional.boolean());
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

/* --- rules between keys ------------------------------------------------------------------------------------------- */

const key_fact& fact_of(const std::string& object, const std::string& key) {
  return *std::find_if(key_facts().begin(), key_facts().end(),
                       [&](const key_fact& fact) { return fact.object == object && fact.key == key; });
}

/* keys that belong to something else; before what they hold is read */
void refuse_unused(const json_node& document) {
  const json_node contact = document.member("contact"), method = contact.member("method"), tip = document.member("tip");
  if (method.absent() || method.value() == fact_of("contact", "method").words.front()) {
    expect_none(contact, {"bands", "watches_motors"}, "contact.method \"paper\"; it belongs to \"bands\"");
  }
  if (document.member("links").absent() && !tip.absent()) {
    throw description_error(tip.path() + ": not allowed without links");
  }
}

/* lists that must be there beside what is; what they hold has been read */
void expect_used(const json_node& document) {
  const json_node contact = document.member("contact");
  if (contact.member("method").value() == fact_of("contact", "method").words.back()) {
    contact.member("bands").expect_list(MODEL_MAX_BANDS, MODEL_MAX_BANDS, fact_of("contact", "bands").holds);
  }
  if (!document.member("links").absent()) {
    document.member("tip").expect_list(3, 3, fact_of("", "tip").holds);
  }
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

}  // namespace

finger_shape read_shape(const json_node& document) {
  finger_shape finger;
  model_shape& shape = finger.shape;
  refuse_dropped(document);
  const json_node joints = document.member("joints"), tendons = document.member("tendons");
  shape.joints = static_cast<std::uint32_t>(joints.value().is_array() ? joints.size() : 0);
  shape.tendons = static_cast<std::uint32_t>(tendons.value().is_array() ? tendons.size() : 0);
  refuse_unused(document);
  read_object(document, "", shape);
  expect_used(document);
  check_estimated(document.member("estimated"));
  for (std::size_t j = 0; j < joints.size(); ++j) {
    finger.words.push_back(word_of_joint(joints.element(j)));
  }
  for (std::size_t i = 0; i < tendons.size(); ++i) {
    add_words_of_tendon(tendons.element(i), shape.joints, finger.words);
  }
  read_extensions(document.member("extensions"), shape.joints, shape.tendons, finger.extensions);
  shape.extension_count = static_cast<std::uint32_t>(finger.extensions.size() / MODEL_EXTENSION_WORDS);
  shape.word_count = static_cast<std::uint32_t>(finger.words.size());
  shape.words = finger.words.data();
  shape.extensions = finger.extensions.data();
  shape.parameter_count = model_count_parameters(&shape);
  return finger;
}

}  // namespace tendonfmu
