#include "extension_reader.h"

#include <string>

#include "core_inside.h"
#include "description_error.h"

namespace tendonfmu {
namespace {

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
  if (effect.joint != PLACE_REFUSED) {
    keys.emplace_back("joint");
  }
  if (effect.tendon != PLACE_REFUSED) {
    keys.emplace_back("tendon");
  }
  if (effect.level) {
    keys.emplace_back("level");
  }
  for (std::uint32_t i = 0; i < effect.parameter_count; ++i) {
    keys.emplace_back(effect.parameters[i].name);
  }
  extension.expect_keys(keys);
}

/* 1 to count, 0 where it is absent and may be */
std::uint32_t read_number(const json_node& node, std::uint32_t count, place_need need, const std::string& meaning) {
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

std::uint32_t read_joint_before_another(const json_node& node, std::uint32_t joints) {
  const std::uint32_t count = joints - 1;
  return read_number(node, count, PLACE_REQUIRED,
                     count ? range_of("joint", count) + ", since the last one has none after it"
                           : std::string("a joint with another one after it; the finger has one joint"));
}

struct effect_position {
  std::uint32_t joint, tendon, level; /* from 1; 0: none */
};

effect_position read_position(const json_node& extension, const effect_type& effect, std::uint32_t joints,
                              std::uint32_t tendons) {
  const json_node joint = extension.member("joint"), tendon = extension.member("tendon");
  if (effect.rule == PLACES_NOT_LAST_JOINT) {
    return {read_joint_before_another(joint, joints), 0u, 0u};
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

}  // namespace

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

}  // namespace tendonfmu
