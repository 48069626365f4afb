// Rig files that are refused, in one line with the key path, and those at the ends of what is allowed.
#include "rig.h"

#include <gtest/gtest.h>

#include "description_error.h"
#include "document_faults.h"
#include "test_plant.h"

namespace {

using test_plant::Json;

std::string refusal_of(const std::string& text) {
  try {
    tendonfmu::plant::read_rig(text.data(), text.size());
  } catch (const tendonfmu::description_error& refused) {
    return refused.what();
  }
  return "";
}

std::string refusal(const Json& rig) {
  return refusal_of(rig.dump());
}

TEST(RigReader, NamesThePlaceOfAFaultWhereverItIs) {
  const Json rig = test_plant::small();
  std::vector<std::string> places;
  for (const std::string& place : document_faults::places(rig)) {
    // the finger has its own tests; a version is for those who run the rig; one gain is that of all channels
    const bool free = place.find("/finger") == 0 || place.find("/recording") == 0 || place == "/version" ||
                      place == "/name" || place.find("/gain") != std::string::npos;
    if (!free) {
      places.push_back(place);
    }
  }
  ASSERT_GT(places.size(), 200u);
  document_faults::expect_refused_everywhere(rig, places, refusal);
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
  for (const char* text : {"", "{", "null", "[]", "1", "\"x\"", "{}", "{\"format\": 1}", "{\"finger\": 1e999}"}) {
    EXPECT_TRUE(document_faults::is_plain(refusal_of(text))) << text;
  }
}

TEST(RigReader, TakesTheLargestOfFingers) {
  EXPECT_EQ(refusal(test_plant::largest()), "");
  EXPECT_EQ(test_plant::read(test_plant::largest()).bristle_count(), 64u * 32u + 32u);
  EXPECT_NE(refusal(test_plant::plain(17, 64)).find("finger.joints has 17"), std::string::npos);
  EXPECT_NE(refusal(test_plant::plain(16, 66)).find("finger.tendons has 66"), std::string::npos);
}

}  // namespace
