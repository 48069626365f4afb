// Rig files that are refused, in one line with the key path, and those at the ends of what is allowed.
#include "rig_reader.h"

#include <gtest/gtest.h>

#include "description_error.h"
#include "test_plant.h"

namespace {

using test_plant::Json;

std::string refusal(const Json& rig) {
  try {
    test_plant::read(rig);
  } catch (const tendonfmu::description_error& refused) {
    return refused.what();
  }
  return "";
}

/* Pointers to all values of a document, those of the finger left out: the description's own tests judge it. */
void collect(const Json& value, const std::string& pointer, std::vector<std::string>* all) {
  if (pointer == "/finger" || pointer == "/recording") {
    return;
  }
  if (!pointer.empty()) {
    all->push_back(pointer);
  }
  if (value.is_object()) {
    for (auto item = value.begin(); item != value.end(); ++item) {
      collect(*item, pointer + "/" + item.key(), all);
    }
  } else if (value.is_array()) {
    for (std::size_t k = 0; k < value.size(); ++k) {
      collect(value[k], pointer + "/" + std::to_string(k), all);
    }
  }
}

/* "/physics/links/0/mass" as "physics.links[1].mass" */
std::string path_of(const std::string& pointer) {
  std::string path;
  std::size_t from = 1;
  while (from <= pointer.size()) {
    const std::size_t end = std::min(pointer.find('/', from), pointer.size());
    const std::string word = pointer.substr(from, end - from);
    if (!word.empty() && word.find_first_not_of("0123456789") == std::string::npos) {
      path += "[" + std::to_string(std::stoul(word) + 1) + "]";
    } else {
      path += (path.empty() ? "" : ".") + word;
    }
    from = end + 1;
  }
  return path;
}

bool is_plain(const std::string& line) {
  return !line.empty() && std::none_of(line.begin(), line.end(), [](unsigned char c) { return c < 0x20; });
}

TEST(RigReader, AcceptsTheSmallRig) {
  const auto rig = test_plant::read(test_plant::small());
  EXPECT_EQ(rig.joint_count(), 3u);
  EXPECT_EQ(rig.tendon_count(), 6u);
  EXPECT_EQ(rig.seed, 7u);
  EXPECT_TRUE(rig.obstacle.present);
  EXPECT_EQ(rig.pushes.size(), 2u);
}

// A wrong type at every key and element: refused, or (null) as if left out; never anything worse.
TEST(RigReader, RefusesWrongTypesEverywhere) {
  std::vector<std::string> pointers;
  collect(test_plant::small(), "", &pointers);
  ASSERT_GT(pointers.size(), 200u);
  const std::vector<Json> wrong = {"text", true, Json::object(), Json::array(), {{"x", 1}}, {1, 2}};
  for (const std::string& pointer : pointers) {
    if (pointer == "/version") {
      continue;  // for those who run the rig
    }
    for (const Json& value : wrong) {
      Json rig = test_plant::small();
      Json& place = rig[Json::json_pointer(pointer)];
      if (place.type() == value.type()) {
        continue;
      }
      // one value for all channels; a list is one for each
      if (value.is_array() && (pointer.find("gain") != std::string::npos)) {
        continue;
      }
      place = value;
      const std::string line = refusal(rig);
      const bool empty_object = value.is_object() && value.empty();
      if (line.empty() && (pointer == "/name" || empty_object)) {
        continue;
      }
      EXPECT_TRUE(is_plain(line)) << pointer << " = " << value;
      const std::string path = path_of(pointer);
      EXPECT_EQ(line.substr(0, path.size()), path) << pointer << " = " << value << ": " << line;
    }
    Json rig = test_plant::small();
    rig[Json::json_pointer(pointer)] = nullptr;
    const std::string line = refusal(rig);
    EXPECT_TRUE(line.empty() || is_plain(line)) << line;
  }
}

TEST(RigReader, RefusesUnknownKeysEverywhere) {
  std::vector<std::string> pointers;
  collect(test_plant::small(), "", &pointers);
  for (const std::string& pointer : pointers) {
    Json rig = test_plant::small();
    Json& place = rig[Json::json_pointer(pointer)];
    if (!place.is_object()) {
      continue;
    }
    place["tpyo"] = 1;
    const std::string line = refusal(rig);
    EXPECT_NE(line.find(path_of(pointer) + ".tpyo: unknown key"), std::string::npos) << pointer << ": " << line;
  }
}

TEST(RigReader, RefusesNumbersOutOfRange) {
  std::vector<std::string> pointers;
  collect(test_plant::small(), "", &pointers);
  for (const std::string& pointer : pointers) {
    if (pointer == "/version" || !test_plant::small()[Json::json_pointer(pointer)].is_number()) {
      continue;
    }
    for (const double value : {1e300, -1e300}) {
      if (pointer.find("direction") != std::string::npos) {
        continue;
      }
      const std::string line = refusal(test_plant::changed({{pointer, value}}));
      EXPECT_EQ(line.substr(0, path_of(pointer).size()), path_of(pointer)) << pointer << " = " << value << ": " << line;
    }
  }
}

TEST(RigReader, NamesKeyValueAndExpectation) {
  const std::vector<std::pair<std::pair<std::string, Json>, std::string>> cases = {
      {{"/format", "tendonfmu-rig-2"}, "format = \"tendonfmu-rig-2\": expected \"tendonfmu-rig-1\""},
      {{"/seed", -1}, "seed = -1: expected"},
      {{"/seed", 1.5}, "seed = 1.5: expected a whole number"},
      {{"/physics/links/1/mass", -0.1}, "physics.links[2].mass = -0.1: expected a number > 0"},
      {{"/physics/links/0/axis", {0, 0, 0}}, "physics.links[1].axis = [...]: expected a direction"},
      {{"/physics/links/0/inertia", {1e-6, 1e-6, 3e-6}}, "physics.links[1].inertia = [...]: expected three moments"},
      {{"/physics/links/0/limits/upper", -0.5}, "physics.links[1].limits.upper = -0.5: expected an angle above"},
      {{"/physics/joint_coupling", {0.01}}, "physics.joint_coupling has 1 element: expected a list of 2 numbers"},
      {{"/physics/friction/edges/0/joint", 1},
       "physics.friction.edges[1].joint = 1: expected a whole number from 2 to 3"},
      {{"/physics/friction/edges/0/tendon", 5}, "physics.friction.edges[1].joint = 2: expected a joint where"},
      {{"/physics/friction/tension_loss", "none"}, "physics.friction.tension_loss = \"none\": expected \"linear\" or"},
      {{"/motion/joints/0/position/0", 0.5}, "motion.joints[1].position[1] = 0.5: expected a start within"},
      {{"/motion/joints/0/time/1", 2}, "motion.joints[1].time[3] = 2: expected a time after"},
      {{"/motion/pretension/value/0", 0}, "motion.pretension.value[1] = 0: expected a number > 0"},
      {{"/pushes/0/link", 4}, "pushes[1].link = 4: expected a whole number from 1 to 3"},
      {{"/finger/tendons/0/bidirectional", true}, "finger.tendons[1].bidirectional = true: expected false"},
      {{"/finger/tendons/0/stiffness", -1}, "finger.tendons[1].stiffness"},
      {{"/finger/joints", Json::array()}, "finger.joints has 0 elements"},
      {{"/finger/extensions", {{{"effect", "cover_hardening"}, {"joint", 1}, {"stiffness", 1}}}}, "finger.extensions"},
      {{"/finger", nullptr}, "finger: missing"},
      {{"/physics", nullptr}, "physics: missing"},
      {{"/motion", nullptr}, "motion: missing"},
  };
  for (const auto& [change, expected] : cases) {
    const std::string line = refusal(test_plant::changed({change}));
    EXPECT_EQ(line.substr(0, expected.size()), expected) << change.first;
  }
}

TEST(RigReader, RefusesFingersThatCannotBePretensioned) {
  Json rig = test_plant::plain(1, 2);
  rig["finger"]["tendons"][1]["moment_arms"] = {0.004};
  EXPECT_NE(refusal(rig).find("positive null vector"), std::string::npos) << refusal(rig);
  for (std::size_t i = 0; i < 2; ++i) {
    rig["finger"]["tendons"][i]["moment_arms"] = {0.0};
  }
  EXPECT_NE(refusal(rig).find("full column rank"), std::string::npos) << refusal(rig);
  EXPECT_NE(refusal(test_plant::plain(2, 2)).find("finger.tendons"), std::string::npos);
}

TEST(RigReader, RefusesFrictionThatLeavesNoTension) {
  const std::string line = refusal(test_plant::changed(
      {{"/finger/tendons/1/edge_friction/0", {{"static", 0.97}, {"coulomb", 0.9}, {"stribeck_velocity", 0.1}}}}));
  EXPECT_NE(line.find("finger.tendons[2]: static friction takes"), std::string::npos) << line;
}

// What counts of a diverted edge is its shape, not the law that it replaces.
TEST(RigReader, RefusesDiversionsThatLeaveNoTension) {
  Json rig = test_plant::plain(2, 4);
  const Json law = {{"static", 0.02}, {"coulomb", 0.02}, {"stribeck_velocity", 0.1}};
  rig["finger"]["tendons"][0]["edge_friction"] = Json::array({nullptr, law});
  Json edge = {{"tendon", 1}, {"joint", 2}, {"shape", "sine"}, {"rest", 0.0}, {"coefficient", 0.5}};
  rig["physics"]["friction"]["edges"] = Json::array({edge});
  EXPECT_EQ(refusal(rig).find("static friction takes"), std::string::npos) << refusal(rig);
  rig["physics"]["friction"]["edges"][0]["coefficient"] = 9.0;
  EXPECT_NE(refusal(rig).find("finger.tendons[1]: static friction takes"), std::string::npos) << refusal(rig);
}

// A bristle that slides one way without friction has no level to bend to.
TEST(RigReader, RefusesFrictionInOneDirectionOnly) {
  const Json none = {{"static", 0.0}, {"coulomb", 0.0}, {"stribeck_velocity", 0.1}};
  EXPECT_EQ(refusal(test_plant::changed({{"/finger/joints/2/friction/positive", none}})).substr(0, 40),
            "finger.joints[3].friction.positive.coulo");
  Json both = test_plant::changed({{"/finger/joints/2/friction/positive", none}});
  both["finger"]["joints"][2]["friction"]["negative"] = none;
  EXPECT_EQ(refusal(both), "");  // a contact without friction
}

TEST(RigReader, RefusesTextsThatAreNoRig) {
  const auto said = [](const std::string& text) {
    try {
      tendonfmu::plant::read_rig(text.data(), text.size());
    } catch (const tendonfmu::description_error& refused) {
      return std::string(refused.what());
    }
    return std::string();
  };
  for (const char* text : {"", "{", "null", "[]", "1", "\"x\"", "{}", "{\"format\": 1}", "{\"finger\": 1e999}"}) {
    EXPECT_TRUE(is_plain(said(text))) << text;
  }
}

TEST(RigReader, TakesTheShortestOfRigs) {
  EXPECT_EQ(refusal(test_plant::plain(1, 2)), "");
  Json rig = test_plant::plain(1, 2);
  rig["physics"]["joint_coupling"] = Json::array();
  rig["physics"]["tendons"] = Json::array();
  rig["physics"]["friction"] = Json::object();
  rig["sensors"] = nullptr;
  rig["pushes"] = Json::array();
  EXPECT_EQ(refusal(rig), "");
}

TEST(RigReader, TakesTheLargestOfFingers) {
  Json rig = test_plant::plain(16, 64);
  const Json law = {{"static", 0.01}, {"coulomb", 0.008}, {"stribeck_velocity", 0.005}};
  for (Json& tendon : rig["finger"]["tendons"]) {
    for (int j = 0; j < 16; ++j) {
      tendon["edge_friction"].push_back(law);
      if (j < 15) {
        tendon["pulley_friction"].push_back(law);
      }
    }
  }
  for (Json& joint : rig["finger"]["joints"]) {
    joint = {{"friction", law}, {"load_friction", law}};
  }
  EXPECT_EQ(refusal(rig), "");
  const auto numbers = test_plant::read(rig);
  EXPECT_EQ(numbers.bristle_count(), 64u * 31u + 32u);
  EXPECT_NE(refusal(test_plant::plain(17, 64)).find("finger.joints has 17"), std::string::npos);
  EXPECT_NE(refusal(test_plant::plain(16, 66)).find("finger.tendons has 66"), std::string::npos);
}

}  // namespace
