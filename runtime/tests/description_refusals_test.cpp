// Descriptions that are refused, and the one line that says why: path, value, range, unit.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "described_finger.h"
#include "document_faults.h"

using nlohmann::json;

namespace {

TEST(Refusal, NamesThePlaceOfAFaultWhereverItIs) {
  json finger = small_finger();
  finger["position_filter"] = {{"noise", {1e-4, 2e-4}}, {"jerk_density", 1.0}};
  const std::vector<std::string> places = document_faults::places(finger);
  ASSERT_GT(places.size(), 70u);
  document_faults::expect_refused_everywhere(finger, places, [](const json& faulty) {
    const Reading reading = read(faulty);
    EXPECT_EQ(reading.status == TENDONFMU_OK, reading.message.empty());
    EXPECT_EQ(reading.status == TENDONFMU_OK, !reading.image.empty());
    return reading.message;
  });
}

// A small finger with the value at `pointer` replaced by `value` (JSON text); "" removes it.
struct Fault {
  const char* pointer;
  const char* value;
  const char* message;
};

json faulty(const Fault& fault) {
  json finger = small_finger();
  const json::json_pointer at(fault.pointer);
  if (*fault.value) {
    finger[at] = json::parse(fault.value);
  } else if (finger[at.parent_pointer()].is_array()) {
    finger[at.parent_pointer()].erase(std::stoul(at.back()));
  } else {
    finger[at.parent_pointer()].erase(at.back());
  }
  return finger;
}

void expect_refused(const std::vector<Fault>& faults) {
  for (const Fault& fault : faults) {
    const std::string message = read(faulty(fault)).message;
    EXPECT_EQ(message.find(fault.message), 0u) << fault.pointer << " = " << fault.value << ": " << message;
  }
}

TEST(Refusal, IsOfWhatIsMissing) {
  expect_refused({
      {"/format", "", "format: missing; expected \"tendonfmu-finger-1\""},
      {"/name", "", "name: missing; expected a text"},
      {"/joints", "", "joints: missing; expected a list of 1 to 16 joints"},
      {"/tendons/1/stiffness", "", "tendons[2].stiffness: missing; expected a number, above 0 and at most 1e+12 N/m"},
      {"/tendons/1/moment_arms", "", "tendons[2].moment_arms: missing; expected a list of 2 numbers in m"},
      {"/contact", "", "contact: missing; expected an object"},
      {"/contact/method", "\"cusum\"",
       "contact.innovation: missing; expected an object with time and threshold, which contact.method needs"},
      {"/contact/method", "\"cusm\"",
       "contact.method = \"cusm\": expected one of \"threshold\", \"innovation\", \"cusum\""},
      {"/contact/threshold", "", "contact.threshold: missing; expected a list of 2 numbers in N.m, one per joint"},
      {"/joints/0/cover", "{}", "joints[1].cover.stiffness: missing"},
      {"/tendons/0/edge_friction/0/negative", "", "tendons[1].edge_friction[1].negative: missing; expected an object"},
      {"/tendons/0/edge_friction/1/angles", "", "tendons[1].edge_friction[2].angles: missing; expected a list of 1 to"},
      {"/tendons/0/edge_friction/1/laws", "", "tendons[1].edge_friction[2].laws: missing; expected a list of 2 laws"},
      {"/extensions/0/effect", "", "extensions[1].effect: missing"},
      {"/extensions/0/joint", "", "extensions[1].joint: missing; expected a joint from 1 to 2"},
      {"/joints/1", "null", "joints[2]: missing; expected an object"},
  });
}

TEST(Refusal, IsOfWrongTypes) {
  expect_refused({
      {"/format", "\"tendonfmu-finger-2\"", "format = \"tendonfmu-finger-2\": expected \"tendonfmu-finger-1\""},
      {"/name", "\"\"", "name = \"\": expected a name of 1 to 200 bytes"},
      {"/name", "\"a\\nb\"", "name = \"a\\nb\": expected a name of 1 to 200 bytes without control characters"},
      {"/joints", R"([{"name": "knuckle"}])",
       "tendons[1].moment_arms has 2 elements: expected a list of 1 number in m"},
      {"/joints", "{}", "joints = {...}: expected a list of 1 to 16 joints"},
      {"/tendons/0/stiffness", "true", "tendons[1].stiffness = true: expected a number, above 0 and at most 1e+12 N/m"},
      {"/tendons/0/stiffness", "\"4000\"", "tendons[1].stiffness = \"4000\": expected a number"},
      {"/tendons/0/bidirectional", "1", "tendons[1].bidirectional = 1: expected true or false"},
      {"/tendons/0/pulley_friction", "{}", "tendons[1].pulley_friction = {...}: expected a list of at most 2 laws"},
      {"/velocity_filter_cutoff", "[20]", "velocity_filter_cutoff = [...]: expected a number, 0 to 1e+09 Hz"},
      {"/contact/threshold", "0.03", "contact.threshold = 0.03: expected a list of 2 numbers in N.m, one per joint"},
      {"/extensions", "{}", "extensions = {...}: expected a list of at most 1024 extensions"},
  });
}

TEST(Refusal, IsOfUnknownKeys) {
  expect_refused({
      {"/joints/1/stiffnes", "1",
       "joints[2].stiffnes: unknown key; expected one of name, cover, friction, load_friction"},
      {"/joints/0/friction/angles", "[0]", "joints[1].friction.angles: unknown key"},
      {"/tendons/0/edge_friction/0/negative/positive", "1",
       "tendons[1].edge_friction[1].negative.positive: unknown key"},
      {"/tendons/0/edge_friction/1/laws/1/laws", "[]", "tendons[1].edge_friction[2].laws[2].laws: unknown key"},
      {"/extensions/0/tendon", "1", "extensions[1].tendon: unknown key; expected one of effect, joint, stiffness"},
  });
}

TEST(Refusal, IsOfWrongLengths) {
  expect_refused({
      {"/joints", "[]", "joints has 0 elements: expected a list of 1 to 16 joints"},
      {"/joints", "[{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}]",
       "joints has 17 elements: expected a list of 1"},
      {"/tendons", "[]", "tendons has 0 elements: expected a list of 1 to 64 tendons"},
      {"/tendons/0/moment_arms", "[0.009]", "tendons[1].moment_arms has 1 element: expected a list of 2 numbers in m"},
      {"/tendons/0/pulley_friction", "[null, null, null]",
       "tendons[1].pulley_friction has 3 elements: expected a list of"},
      {"/tendons/0/edge_friction", "[null, null, null]",
       "tendons[1].edge_friction has 3 elements: expected a list of at"},
      {"/tendons/0/edge_friction/1/laws/1", "", "tendons[1].edge_friction[2].laws has 1 element: expected a list of 2"},
      {"/tendons/0/edge_friction/1/angles", "[]",
       "tendons[1].edge_friction[2].angles has 0 elements: expected a list of"},
      {"/bias/initial_torque", "[0.1]", "bias.initial_torque has 1 element: expected a list of 2 numbers in N.m"},
  });
}

const char* const law = R"({"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005})";

TEST(Refusal, IsOfWhatContradictsItself) {
  expect_refused({
      {"/tendons/0/pulley_friction/1", law,
       "tendons[1].pulley_friction[2] = {...}: expected null, since no joint comes"},
      {"/tendons/0/edge_friction/0/static", "1", "tendons[1].edge_friction[1].static: not allowed beside positive and"},
      {"/tendons/0/edge_friction/1/static", "1",
       "tendons[1].edge_friction[2].static: not allowed beside angles and laws"},
      {"/extensions/0/effect", "\"gravity\"",
       "extensions[1].stiffness: unknown key; expected one of effect, joint, sine"},
      {"/extensions/0/effect", "\"dragons\"",
       "extensions[1].effect = \"dragons\": expected one of cover_hardening, gravity,"},
      {"/extensions/0/effect", "\"gravity\\u0000\"", "extensions[1].effect = \"gravity"},
      {"/extensions/0/effect", "\"asymmetric_friction\"",
       "extensions[1].effect = \"asymmetric_friction\": no extension: it is a friction law with positive and negative"},
      {"/extensions/0/effect", "\"edge_friction\"",
       "extensions[1].effect = \"edge_friction\": no extension: it is the list edge_friction of a tendon"},
      {"/extensions/0/effect", "\"contact\"",
       "extensions[1].effect = \"contact\": no extension: it belongs to a recording"},
      {"/extensions/0/joint", "3", "extensions[1].joint = 3: expected a joint from 1 to 2"},
      {"/extensions/0/joint", "1.5", "extensions[1].joint = 1.5: expected a joint from 1 to 2"},
      {"/extensions/0/joint", "1e300", "extensions[1].joint = 1e+300: expected a joint from 1 to 2"},
  });
}

TEST(Refusal, IsOfNumbersOutOfRange) {
  expect_refused({
      {"/joints/0/friction/viscous", "-0.001", "joints[1].friction.viscous = -0.001: expected 0 to 1e+09 N.m.s/rad"},
      {"/joints/0/friction/stribeck_velocity", "0",
       "joints[1].friction.stribeck_velocity = 0: expected above 0 and at most 1e+09 rad/s"},
      {"/joints/0/friction/static", "0.005", "joints[1].friction.static = 0.005: expected at least coulomb = 0.006"},
      {"/tendons/0/edge_friction/0/negative/static", "0.02",
       "tendons[1].edge_friction[1].negative.static = 0.02: expected at least coulomb = 0.03"},
      {"/tendons/0/stiffness", "0", "tendons[1].stiffness = 0: expected above 0 and at most 1e+12 N/m"},
      {"/tendons/0/stiffness", "1e300", "tendons[1].stiffness = 1e+300: expected above 0 and at most 1e+12 N/m"},
      {"/tendons/0/edge_friction/1/angles", "[0.5, 0.5]",
       "tendons[1].edge_friction[2].angles[2] = 0.5: expected above the angle before it, 0.5 rad"},
      {"/tendons/0/edge_friction/1/angles", "[0.5, -0.5]",
       "tendons[1].edge_friction[2].angles[2] = -0.5: expected above the angle before it, 0.5 rad"},
      {"/position_filter", "{}", "position_filter.noise: missing; expected a list of 2 numbers in rad, one per joint"},
      {"/position_filter", R"({"noise": [1e-4]})",
       "position_filter.noise has 1 element: expected a list of 2 numbers in rad, one per joint"},
      {"/position_filter", R"({"noise": [1e-4, 0]})", "position_filter.noise[2] = 0: expected 1e-06 to 1000 rad"},
      {"/position_filter", R"({"noise": [1e-4, 1e-4], "jerk_density": 0})",
       "position_filter.jerk_density = 0: expected above 0 and at most 1e+09 rad2/s5"},
      {"/position_filter", R"({"noise": [1e-4, 1e-4], "jerk": 1})",
       "position_filter.jerk: unknown key; expected one of noise, jerk_density"},
      {"/tendons/1/moment_arms", "[0.018, 0.008]", "tendons: moment_arms are not of full column rank"},
  });
}

TEST(Refusal, IsOfExtensionsThatCannotBe) {
  expect_refused({
      {"/extensions/0", R"({"effect": "force_gain", "correction": 0.1})",
       "extensions[1].tendon: missing; expected a tendon from 1 to 2"},
      {"/extensions/0", R"({"effect": "force_gain", "tendon": 3, "correction": 0.1})",
       "extensions[1].tendon = 3: expected a tendon from 1 to 2"},
      {"/extensions/0", R"({"effect": "force_gain", "tendon": 1, "joint": 1, "correction": 0.1})",
       "extensions[1].joint: unknown key; expected one of effect, tendon, correction"},
      {"/extensions/0", R"({"effect": "force_gain", "tendon": 1, "correction": -1})",
       "extensions[1].correction = -1: expected above -1 and at most 1e+09 1"},
      {"/extensions/0", R"({"effect": "moment_arm", "tendon": 1, "correction": 0.1})",
       "extensions[1].joint: missing; expected a joint from 1 to 2"},
      {"/extensions/0", R"({"effect": "preload_friction", "joint": 1, "coulomb": 0.1})",
       "extensions[1].tendon: missing; expected a tendon from 1 to 2"},
      {"/extensions/0", R"({"effect": "preload_friction", "tendon": 1, "joint": 0, "coulomb": 0.1})",
       "extensions[1].joint = 0: expected a joint from 1 to 2"},
      {"/extensions/0", R"({"effect": "joint_coupling", "joint": 2, "stiffness": 0.1})",
       "extensions[1].joint = 2: expected a joint from 1 to 1, since the last one has none after it"},
      {"/extensions/0", R"({"effect": "backlash", "width": 0.1})",
       "extensions[1].joint: missing; expected a joint from 1 to 2, or tendon in its place"},
      {"/extensions/0", R"({"effect": "presliding", "joint": 1, "tendon": 1, "displacement": 0.1})",
       "extensions[1].tendon: not allowed beside joint; presliding acts at one of them"},
      {"/extensions/0", R"({"effect": "presliding", "joint": 1, "displacement": 0})",
       "extensions[1].displacement = 0: expected above 0 and at most 1e+09 rad"},
      {"/extensions/0", R"({"effect": "presliding", "tendon": 1, "displacement": 0})",
       "extensions[1].displacement = 0: expected above 0 and at most 1e+09 m"},
      {"/extensions/0", R"({"effect": "presliding", "displacement": 0})",
       "extensions[1].displacement = 0: expected above 0 and at most 1e+09 s"},
      {"/extensions",
       R"([{"effect": "presliding", "displacement": 1}, {"effect": "presliding", "joint": 1, "displacement": 1},
         {"effect": "presliding", "joint": null, "displacement": 2}])",
       "extensions[3].effect = \"presliding\": expected once, and extensions[1] is the same"},
      {"/extensions/0", R"({"effect": "stribeck", "joint": 1, "amplitude": -1, "stribeck_velocity": 1})",
       "extensions[1].amplitude = -1: expected -0.99 to 1e+09 1"},
      {"/extensions/0", R"({"effect": "time_delay", "delay": 0.06})",
       "extensions[1].delay = 0.06: expected -0.05 to 0.05 s"},
      {"/extensions", R"([{"effect": "time_delay", "delay": 0}, {"effect": "time_delay", "delay": 0.01}])",
       "extensions[2].effect = \"time_delay\": expected once, and extensions[1] is the same"},
      {"/extensions",
       R"([{"effect": "backlash", "tendon": 1, "width": 0}, {"effect": "backlash", "joint": 1, "width": 0},
         {"effect": "backlash", "tendon": 1, "width": 1}])",
       "extensions[3].effect = \"backlash\": expected once a place, and extensions[1] is the same"},
  });
}

TEST(Refusal, ACouplingNeedsTwoJoints) {
  json finger = small_finger();
  finger["joints"].erase(1);
  finger["tendons"] = json::parse(R"([{"stiffness": 4000, "moment_arms": [0.01]}])");
  finger["contact"] = {{"threshold", {0.1}}};
  finger["bias"] = nullptr;
  finger["extensions"] = json::parse(R"([{"effect": "joint_coupling", "joint": 1, "stiffness": 0.1}])");
  EXPECT_EQ(read(finger).message,
            "extensions[1].joint = 1: expected a joint with another one after it; the finger has one joint");
}

TEST(Refusal, FewerTendonsThanJointsCannotFixTheAngles) {
  json finger = small_finger();
  finger["tendons"].erase(1);
  EXPECT_NE(read(finger).message.find("full column rank"), std::string::npos) << read(finger).message;
}

TEST(Refusal, ShowsLongAndStrangeValuesCutAndPrintable) {
  json finger = small_finger();
  finger["tendons"][0]["stiffness"] = std::string(1000, 'x');
  const std::string cut = read(finger).message;
  EXPECT_LT(cut.size(), 200u);
  EXPECT_NE(cut.find("xxx...: expected a number"), std::string::npos) << cut;
  finger = small_finger();
  finger["line\nbreak\x7f" + std::string(300, 'y')] = 1;
  const std::string key = read(finger).message;
  EXPECT_EQ(key.find("line?break?yyy"), 0u) << key;
  EXPECT_LT(key.size(), 250u);
}

TEST(Refusal, IsCutBetweenCharacters) {
  const std::string text = R"({"ä": 1})";
  for (std::size_t size = 1; size < 12; ++size) {
    std::string message(size + 1, '#');
    void* image = &message;
    std::size_t image_size = 1;
    EXPECT_EQ(tendonfmu_image_from_json(text.data(), text.size(), &image, &image_size, message.data(), size),
              TENDONFMU_BAD_IMAGE);
    EXPECT_EQ(image, nullptr);
    EXPECT_EQ(image_size, 0u);
    EXPECT_EQ(message[size], '#');
    const std::string whole = "ä: unknown key";
    const std::string expected = size == 1 || size == 2 ? "" : whole.substr(0, size - 1);
    EXPECT_STREQ(message.c_str(), expected.c_str()) << size;
  }
}

TEST(Refusal, NullArgumentsAreArgumentErrors) {
  void* image = nullptr;
  std::size_t size = 0;
  char message[10];
  EXPECT_EQ(tendonfmu_image_from_json(nullptr, 0, &image, &size, message, 10), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_image_from_json("{}", 2, nullptr, &size, message, 10), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_image_from_json("{}", 2, &image, nullptr, message, 10), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_image_from_json("{}", 2, &image, &size, nullptr, 10), TENDONFMU_BAD_ARGUMENT);
  EXPECT_EQ(tendonfmu_image_from_json("{}", 2, &image, &size, nullptr, 0), TENDONFMU_BAD_IMAGE);
}

}  // namespace
