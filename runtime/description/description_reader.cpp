/* The C interface, tendonfmu_description.h: parse, read which things there are, read their numbers, check, write. */
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "core_inside.h"
#include "description_error.h"
#include "description_keys.h"
#include "json_node.h"
#include "tendonfmu_description.h"

namespace tendonfmu {
namespace {

constexpr const char* format_name = "tendonfmu-finger-1";
constexpr std::size_t max_name_bytes = 200;

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

/* of a law, and of an edge, which may be working points in its place */
std::vector<std::string> any_law_keys(const std::vector<std::string>& more = {}) {
  std::vector<std::string> keys = law_keys();
  keys.insert(keys.end(), {"positive", "negative"});
  keys.insert(keys.end(), more.begin(), more.end());
  return keys;
}

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

/* an edge's law, or its working points */
void read_edge(const json_node& edge, std::vector<std::uint32_t>& words) {
  if (edge.absent()) {
    return words.push_back(0);
  }
  const json_node angles = edge.member("angles"), laws = edge.member("laws");
  edge.expect_keys(any_law_keys({"angles", "laws"}));
  if (angles.absent() && laws.absent()) {
    words.insert(words.end(), {1u, static_cast<std::uint32_t>(kind_of_law(edge))});
    return;
  }
  expect_none(edge, any_law_keys(), "angles and laws");
  angles.expect_list(1, MODEL_MAX_POINTS, "angles in rad, strictly increasing");
  laws.expect_list(angles.size(), angles.size(), "laws, one per angle");
  words.push_back(static_cast<std::uint32_t>(angles.size()) | MODEL_EDGE_HAS_ANGLES);
  for (std::size_t k = 0; k < angles.size(); ++k) {
    words.push_back(kind_of_law(laws.element(k).expect_keys(any_law_keys())));
  }
}

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

/* --- extensions: which effects, and where ---------------------------------------------------------------------------
 */

/* Names of effects (docs/reference/commands/diagnose.md) that are no extensions, and where what they name stands. */
struct elsewhere {
  const char *name, *where;
};
const elsewhere no_extensions[] = {
    {"viscous_friction", "it is the number viscous of a friction law"},
    {"asymmetric_friction", "it is a friction law with positive and negative"},
    {"edge_friction", "it is the list edge_friction of a tendon"},
    {"pulley_friction", "it is the list pulley_friction of a tendon"},
    {"joint_friction", "it is the law friction of a joint"},
    {"joint_load_friction", "it is the law load_friction of a joint"},
    {"cover_stiffness", "it is the number cover.stiffness of a joint"},
    {"relaxation", "it is the number relaxation_time of presliding"},
    {"contact", "it belongs to a recording, not to a finger"},
    {"unknown", "it belongs to a recording, not to a finger"},
};

const effect_type* read_effect(const json_node& node) {
  const std::string name = node.text();
  std::string known;
  for (std::size_t i = 0; effect_at(i); ++i) {
    if (name == effect_at(i)->name) {
      return effect_at(i);
    }
    known += (known.empty() ? "" : ", ") + std::string(effect_at(i)->name);
  }
  for (const elsewhere& other : no_extensions) {
    if (name == other.name) {
      throw description_error(node.path() + " = \"" + name + "\": no extension: " + other.where);
    }
  }
  node.refuse("one of " + known);
}

void check_keys(const json_node& extension, const effect_type& effect) {
  std::vector<std::string> keys = {"effect"};
  for (const auto& [key, has] :
       {std::pair("joint", effect.joint != PLACE_REFUSED), std::pair("tendon", effect.tendon != PLACE_REFUSED),
        std::pair("level", effect.level != 0)}) {
    keys.insert(keys.end(), has ? 1 : 0, key);
  }
  for (std::uint32_t i = 0; i < effect.parameter_count; ++i) {
    keys.emplace_back(effect.parameters[i].name);
  }
  extension.expect_keys(keys);
}

/* 1 to count, 0 where it is absent and may be */
std::uint32_t read_number(const json_node& node, std::uint32_t count, unsigned need, const std::string& meaning) {
  if (node.absent() && need != PLACE_REQUIRED) {
    return 0;
  }
  if (node.value().is_number()) {
    const double number = node.value().get<double>();
    if (number >= 1.0 && number <= count && number == static_cast<std::uint32_t>(number)) {
      return static_cast<std::uint32_t>(number);
    }
  }
  node.refuse(meaning);
}

std::string range_of(const char* what, std::uint32_t count) {
  return std::string("a ") + what + " from 1 to " + std::to_string(count);
}

struct effect_position {
  std::uint32_t joint, tendon, level; /* from 1; 0: none */
};

effect_position read_position(const json_node& extension, const effect_type& effect, std::uint32_t joints,
                              std::uint32_t tendons) {
  const json_node joint = extension.member("joint"), tendon = extension.member("tendon");
  if (effect.rule == PLACES_NOT_LAST_JOINT) {
    const std::uint32_t count = joints - 1;
    return {read_number(joint, count, PLACE_REQUIRED,
                        count ? range_of("joint", count) + ", since the last one has none after it"
                              : std::string("a joint with another one after it; the finger has one joint")),
            0u, 0u};
  }
  if (effect.rule == PLACES_LEVEL_ALONE && !extension.member("level").absent()) {
    const json_node level = extension.member("level");
    if (!joint.absent() || !tendon.absent()) {
      throw description_error(level.path() + ": not allowed beside joint or tendon; a level has all tendons");
    }
    return {0u, 0u, read_number(level, joints, PLACE_OPTIONAL, range_of("joint", joints))};
  }
  if ((effect.rule == PLACES_EXACTLY_ONE || effect.rule == PLACES_AT_MOST_ONE) && !joint.absent() && !tendon.absent()) {
    throw description_error(tendon.path() + ": not allowed beside joint; " + effect.name + " acts at one of them");
  }
  if (effect.rule == PLACES_EXACTLY_ONE && joint.absent() && tendon.absent()) {
    joint.refuse(range_of("joint", joints) + ", or tendon in its place");
  }
  return {read_number(joint, joints, effect.joint, range_of("joint", joints)),
          read_number(tendon, tendons, effect.tendon, range_of("tendon", tendons)), 0u};
}

/* refuses a row that stands in the table already as often as its effect may at a place */
void check_most(const json_node& extension, const effect_type& effect, const effect_position& at,
                const std::vector<std::uint32_t>& table) {
  int same = 0;
  for (std::size_t row = 0; effect.most && row < table.size(); row += MODEL_EXTENSION_WORDS) {
    same += table[row] == effect.id && table[row + 1] == at.joint && table[row + 2] == at.tendon &&
            table[row + 3] == at.level;
    if (same == effect.most) {
      const json_node name = extension.member("effect");
      throw description_error(name.path() + " = \"" + effect.name + "\": expected " +
                              (effect.most == 1 ? "once" : "twice at most") +
                              (at.joint || at.tendon || at.level ? " a place" : "") + ", and extensions[" +
                              std::to_string(row / MODEL_EXTENSION_WORDS + 1) + "] is the same");
    }
  }
}

/* Appends a row of MODEL_EXTENSION_WORDS for each element to table: effect id, joint, tendon, level (from 1; 0 where
 * there is none). */
void read_extensions(const json_node& list, std::uint32_t joints, std::uint32_t tendons,
                     std::vector<std::uint32_t>& table) {
  if (list.absent()) {
    return;
  }
  list.expect_list(0, MODEL_MAX_EXTENSIONS, "extensions");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const json_node extension = list.element(i);
    const effect_type* effect = read_effect(extension.expect_object().member("effect"));
    check_keys(extension, *effect);
    const effect_position at = read_position(extension, *effect, joints, tendons);
    check_most(extension, *effect, at, table);
    table.insert(table.end(), {effect->id, at.joint, at.tendon, at.level});
  }
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

/* --- which things a finger has --------------------------------------------------------------------------------------
 */

/* Which things a finger has; `shape` points into the two tables. */
struct finger_shape {
  model_shape shape{};
  std::vector<std::uint32_t> words, extensions;

  finger_shape() = default;
  finger_shape(finger_shape&&) = default; /* a moved vector keeps its block */
  finger_shape(const finger_shape&) = delete;
  finger_shape& operator=(const finger_shape&) = delete;
};

/* Walks the whole document: keys, lists and their lengths, names, flags. Numbers are left to read_values(). */
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

/* --- their numbers --------------------------------------------------------------------------------------------------
 */

/* Value of a number that is left out; NaN where it may not be. */
double default_value(const model_item& item, std::uint32_t offset) {
  if (item.kind == ITEM_EXTENSION) {
    return effect_expectation_of(item.effect, offset)->missing_value;
  }
  return key_row_of(item.kind, offset)->has_default ? default_of(item.kind) : NAN;
}

double read_value(const json_node& document, const model_item& item, std::uint32_t index) {
  char path[PARAMETER_PATH_BYTES];
  parameter_path(&item, index, path);
  const json_node node = document.find(path);
  if (node.value().is_number()) {
    return node.value().get<double>();
  }
  const double missing = default_value(item, index - item.first);
  if (node.absent() && !std::isnan(missing)) {
    return missing;
  }
  char range[120] = "";
  parameter_say_range(&item, index, message_line{range, sizeof range});
  node.refuse("a number, " + std::string(range));
}

/* values of all parameters [parameter_count] in the core's order, each found in the document under the core's path for
 * it; defaults where it is absent. Not checked against the ranges. */
std::vector<double> read_values(const json_node& document, const model_shape& shape) {
  std::vector<double> values(shape.parameter_count);
  visit_items(shape, [&](const model_item& item) {
    for (std::uint32_t i = item.first; i < item.first + item.count; ++i) {
      values[i] = read_value(document, item, i);
    }
  });
  return values;
}

/* --- the interface --------------------------------------------------------------------------------------------------
 */

struct free_block {
  void operator()(void* block) const { std::free(block); }
};
using image_block = std::unique_ptr<void, free_block>;

image_block make_image(const char* text, std::size_t text_size, std::size_t* size) {
  const json document = parse_document(text, text_size);
  const json_node root(document);
  const finger_shape finger = read_shape(root);
  const std::vector<double> values = read_values(root, finger.shape);
  char reason[400];
  if (parameter_check_all(&finger.shape, values.data(), message_line{reason, sizeof reason})) {
    throw description_error(reason);
  }
  *size = model_image_size(&finger.shape);
  image_block image(std::malloc(*size));
  if (!image) {
    throw std::bad_alloc();
  }
  model_write(&finger.shape, values.data(), image.get());
  return image;
}

}  // namespace
}  // namespace tendonfmu

tendonfmu_status tendonfmu_image_from_json(const char* json, size_t json_size, void** image, size_t* image_size,
                                           char* message, size_t message_size) {
  if (!json || !image || !image_size || (!message && message_size)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  *image = nullptr;
  *image_size = 0;
  tendonfmu::copy_line("", message, message_size);
  try {
    std::size_t size = 0;
    *image = tendonfmu::make_image(json, json_size, &size).release();
    *image_size = size;
    return TENDONFMU_OK;
  } catch (const std::bad_alloc&) {
    tendonfmu::copy_line("out of memory for this description", message, message_size);
  } catch (const std::exception& error) {
    tendonfmu::copy_line(error.what(), message, message_size);
  } catch (...) {
    tendonfmu::copy_line("description refused for an unknown reason", message, message_size);
  }
  return TENDONFMU_BAD_IMAGE;
}

void tendonfmu_free_image(void* image) {
  std::free(image);
}
