// Descriptions that are refused, and the one line that says why: path, value, range, unit.
#include <gtest/gtest.h>

#include <ostream>
#include <string>
#include <vector>

#include "described_finger.h"

using nlohmann::json;

namespace {

// A small finger with the value at `pointer` replaced by `value` (JSON text); "" removes it.
struct Fault {
  const char* pointer;
  const char* value;
  const char* message;
};

std::ostream& operator<<(std::ostream& out, const Fault& fault) {
  return out << fault.pointer << " = " << fault.value;
}

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

class Refused : public testing::TestWithParam<Fault> {};

TEST_P(Refused, InOneLineThatSaysWhy) {
  const Reading reading = read(faulty(GetParam()));
  EXPECT_EQ(reading.status, TENDONFMU_BAD_IMAGE);
  EXPECT_TRUE(reading.image.empty());
  EXPECT_NE(reading.message.find(GetParam().message), std::string::npos) << reading.message;
  EXPECT_EQ(reading.message.find('\n'), std::string::npos);
}

const std::vector<Fault> missing = {
    {"/format", "", "format: missing; expected \"tendonfmu-finger-1\""},
    {"/format", "null", "format: missing"},
    {"/name", "", "name: missing; expected a text"},
    {"/joints", "", "joints: missing; expected a list of 1 to 16 joints"},
    {"/tendons", "null", "tendons: missing; expected a list of 1 to 64 tendons"},
    {"/tendons/1/stiffness", "", "tendons[2].stiffness: missing; expected a number, above 0 and at most 1e+12 N/m"},
    {"/tendons/1/moment_arms", "", "tendons[2].moment_arms: missing; expected a list of 2 numbers in m"},
    {"/tendons/1/moment_arms/0", "null", "tendons[2].moment_arms[1]: missing; expected a number, -1000 to 1000 m"},
    {"/contact", "", "contact: missing; expected an object"},
    {"/contact/method", "\"cusum\"",
     "contact.innovation: missing; expected an object with time and threshold, which contact.method needs"},
    {"/contact/method", "\"cusm\"",
     "contact.method = \"cusm\": expected one of \"threshold\", \"innovation\", \"cusum\""},
    {"/contact/threshold", "", "contact.threshold: missing; expected a list of 2 numbers in N.m, one per joint"},
    {"/contact/threshold/1", "null", "contact.threshold[2]: missing; expected a number, 0 to 1e+09 N.m"},
    {"/joints/0/cover", "{}", "joints[1].cover.stiffness: missing"},
    {"/joints/0/friction/static", "", "joints[1].friction.static: missing; expected a number, 0 to 1e+09 N.m"},
    {"/joints/1/friction", "{}", "joints[2].friction.static: missing"},
    {"/joints/0/load_friction/stribeck_velocity", "null", "joints[1].load_friction.stribeck_velocity: missing"},
    {"/tendons/0/edge_friction/0/negative", "", "tendons[1].edge_friction[1].negative: missing; expected an object"},
    {"/tendons/0/edge_friction/1/angles", "", "tendons[1].edge_friction[2].angles: missing; expected a list of 1 to"},
    {"/tendons/0/edge_friction/1/laws", "", "tendons[1].edge_friction[2].laws: missing; expected a list of 2 laws"},
    {"/tendons/0/edge_friction/1/laws/0", "null", "tendons[1].edge_friction[2].laws[1]: missing; expected an object"},
    {"/tendons/0/edge_friction/1/angles/0", "null", "tendons[1].edge_friction[2].angles[1]: missing"},
    {"/bias/initial_torque/1", "null", "bias.initial_torque[2]: missing"},
    {"/extensions/0/effect", "", "extensions[1].effect: missing"},
    {"/extensions/0/joint", "", "extensions[1].joint: missing; expected a joint from 1 to 2"},
    {"/extensions/0/stiffness", "null", "extensions[1].stiffness: missing"},
    {"/joints/1", "null", "joints[2]: missing; expected an object"},
};
INSTANTIATE_TEST_SUITE_P(Missing, Refused, testing::ValuesIn(missing));

const std::vector<Fault> unknown_keys = {
    {"/Name", "1", "Name: unknown key; expected one of format, name, joints, tendons"},
    {"/comment", "null", "comment: unknown key"},
    {"/joints/1/stiffnes", "1",
     "joints[2].stiffnes: unknown key; expected one of name, cover, friction, load_friction"},
    {"/joints/0/cover/hardening", "1", "joints[1].cover.hardening: unknown key; expected one of stiffness, rest_angle"},
    {"/joints/0/friction/vs", "1", "joints[1].friction.vs: unknown key; expected one of static, coulomb"},
    {"/joints/0/friction/angles", "[0]", "joints[1].friction.angles: unknown key"},
    {"/tendons/1/length", "1", "tendons[2].length: unknown key; expected one of name, stiffness"},
    {"/tendons/0/pulley_friction/0/k", "1", "tendons[1].pulley_friction[1].k: unknown key"},
    {"/tendons/0/edge_friction/0/negative/positive", "1", "tendons[1].edge_friction[1].negative.positive: unknown key"},
    {"/tendons/0/edge_friction/1/laws/1/laws", "[]", "tendons[1].edge_friction[2].laws[2].laws: unknown key"},
    {"/tendons/0/edge_friction/1/torque", "1", "tendons[1].edge_friction[2].torque: unknown key"},
    {"/velocity_threshold/force", "1", "velocity_threshold.force: unknown key; expected one of tendon, joint"},
    {"/bias/gain", "1", "bias.gain: unknown key; expected one of drift_variance"},
    {"/contact/thresholds", "[1, 1]", "contact.thresholds: unknown key"},
    {"/extensions/0/tendon", "1", "extensions[1].tendon: unknown key; expected one of effect, joint, stiffness"},
};
INSTANTIATE_TEST_SUITE_P(UnknownKeys, Refused, testing::ValuesIn(unknown_keys));

const std::vector<Fault> wrong_types = {
    {"/format", "\"tendonfmu-finger-2\"", "format = \"tendonfmu-finger-2\": expected \"tendonfmu-finger-1\""},
    {"/format", "1", "format = 1: expected \"tendonfmu-finger-1\""},
    {"/name", "5", "name = 5: expected a text"},
    {"/name", "\"\"", "name = \"\": expected a name of 1 to 200 bytes"},
    {"/name", "\"a\\nb\"", "name = \"a\\nb\": expected a name of 1 to 200 bytes without control characters"},
    {"/joints/1/name", "[]", "joints[2].name = [...]: expected a text"},
    {"/tendons/0/name", "true", "tendons[1].name = true: expected a text"},
    {"/joints", R"([{"name": "knuckle"}])", "tendons[1].moment_arms has 2 elements: expected a list of 1 number in m"},
    {"/joints", "{}", "joints = {...}: expected a list of 1 to 16 joints"},
    {"/joints/0", "3", "joints[1] = 3: expected an object"},
    {"/joints/0/cover", "[]", "joints[1].cover = [...]: expected an object"},
    {"/joints/0/friction", "0.5", "joints[1].friction = 0.5: expected an object"},
    {"/tendons", "\"none\"", "tendons = \"none\": expected a list of 1 to 64 tendons"},
    {"/tendons/0/stiffness", "true", "tendons[1].stiffness = true: expected a number, above 0 and at most 1e+12 N/m"},
    {"/tendons/0/stiffness", "\"4000\"", "tendons[1].stiffness = \"4000\": expected a number"},
    {"/tendons/0/moment_arms", "0.009", "tendons[1].moment_arms = 0.009: expected a list of 2 numbers in m"},
    {"/tendons/0/moment_arms/1", "false", "tendons[1].moment_arms[2] = false: expected a number"},
    {"/tendons/0/bidirectional", "1", "tendons[1].bidirectional = 1: expected true or false"},
    {"/tendons/0/bidirectional", "\"true\"", "tendons[1].bidirectional = \"true\": expected true or false"},
    {"/tendons/0/pulley_friction", "{}", "tendons[1].pulley_friction = {...}: expected a list of at most 2 laws"},
    {"/tendons/0/edge_friction/0", "[]", "tendons[1].edge_friction[1] = [...]: expected an object"},
    {"/tendons/0/edge_friction/1/laws/0", "[]", "tendons[1].edge_friction[2].laws[1] = [...]: expected an object"},
    {"/tendons/0/edge_friction/1/angles", "0", "tendons[1].edge_friction[2].angles = 0: expected a list of 1 to 256"},
    {"/tendons/0/edge_friction/1/angles/1", "\"x\"",
     "tendons[1].edge_friction[2].angles[2] = \"x\": expected a number"},
    {"/velocity_threshold", "0.1", "velocity_threshold = 0.1: expected an object"},
    {"/velocity_filter_cutoff", "[20]", "velocity_filter_cutoff = [...]: expected a number, 0 to 1e+09 Hz"},
    {"/bias", "false", "bias = false: expected an object"},
    {"/bias/noise_std", "{}", "bias.noise_std = {...}: expected a number, 0 to 1e+09 N.m"},
    {"/bias/initial_torque", "0.1", "bias.initial_torque = 0.1: expected a list of 2 numbers in N.m"},
    {"/contact", "[]", "contact = [...]: expected an object"},
    {"/contact/threshold", "0.03", "contact.threshold = 0.03: expected a list of 2 numbers in N.m, one per joint"},
    {"/contact/threshold/0", "true", "contact.threshold[1] = true: expected a number"},
    {"/extensions", "{}", "extensions = {...}: expected a list of at most 1024 extensions"},
    {"/extensions/0", "\"cover_hardening\"", "extensions[1] = \"cover_hardening\": expected an object"},
    {"/extensions/0/stiffness", "\"x\"", "extensions[1].stiffness = \"x\": expected a number"},
};
INSTANTIATE_TEST_SUITE_P(WrongTypes, Refused, testing::ValuesIn(wrong_types));

const std::vector<Fault> lengths = {
    {"/joints", "[]", "joints has 0 elements: expected a list of 1 to 16 joints"},
    {"/joints", "[{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}]", "joints has 17 elements: expected a list of 1"},
    {"/tendons", "[]", "tendons has 0 elements: expected a list of 1 to 64 tendons"},
    {"/tendons/0/moment_arms", "[0.009]", "tendons[1].moment_arms has 1 element: expected a list of 2 numbers in m"},
    {"/tendons/0/moment_arms", "[1, 2, 3]", "tendons[1].moment_arms has 3 elements: expected a list of 2 numbers"},
    {"/tendons/0/pulley_friction", "[null, null, null]",
     "tendons[1].pulley_friction has 3 elements: expected a list of"},
    {"/tendons/0/edge_friction", "[null, null, null]",
     "tendons[1].edge_friction has 3 elements: expected a list of at"},
    {"/tendons/0/edge_friction/1/laws/1", "", "tendons[1].edge_friction[2].laws has 1 element: expected a list of 2"},
    {"/tendons/0/edge_friction/1/angles/1", "",
     "tendons[1].edge_friction[2].laws has 2 elements: expected a list of 1"},
    {"/tendons/0/edge_friction/1/angles", "[]",
     "tendons[1].edge_friction[2].angles has 0 elements: expected a list of"},
    {"/bias/initial_torque", "[0.1]", "bias.initial_torque has 1 element: expected a list of 2 numbers in N.m"},
    {"/contact/threshold", "[0.1, 0.1, 0.1]", "contact.threshold has 3 elements: expected a list of 2 numbers in N.m"},
    {"/contact/threshold_per_force", "[0]", "contact.threshold_per_force has 1 element: expected a list of 2 numbers"},
};
INSTANTIATE_TEST_SUITE_P(Lengths, Refused, testing::ValuesIn(lengths));

const char* const law = R"({"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005})";
const std::vector<Fault> contradictions = {
    {"/tendons/0/pulley_friction/1", law, "tendons[1].pulley_friction[2] = {...}: expected null, since no joint comes"},
    {"/tendons/0/edge_friction/0/static", "1", "tendons[1].edge_friction[1].static: not allowed beside positive and"},
    {"/tendons/0/edge_friction/1/static", "1",
     "tendons[1].edge_friction[2].static: not allowed beside angles and laws"},
    {"/tendons/0/edge_friction/1/negative", law, "tendons[1].edge_friction[2].negative: not allowed beside angles and"},
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
    {"/extensions/0/joint", "0", "extensions[1].joint = 0: expected a joint from 1 to 2"},
    {"/extensions/0/joint", "-1", "extensions[1].joint = -1: expected a joint from 1 to 2"},
    {"/extensions/0/joint", "1.5", "extensions[1].joint = 1.5: expected a joint from 1 to 2"},
    {"/extensions/0/joint", "1e300", "extensions[1].joint = 1e+300: expected a joint from 1 to 2"},
};
INSTANTIATE_TEST_SUITE_P(Contradictions, Refused, testing::ValuesIn(contradictions));

const std::vector<Fault> ranges = {
    {"/joints/0/cover/stiffness", "-1", "joints[1].cover.stiffness = -1: expected 0 to 1e+09 N.m/rad"},
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
    {"/velocity_threshold/tendon", "-1", "velocity_threshold.tendon = -1: expected 0 to 1e+09 m/s"},
    {"/velocity_filter_cutoff", "-20", "velocity_filter_cutoff = -20: expected 0 to 1e+09 Hz"},
    {"/position_filter", "{}", "position_filter.noise: missing; expected a list of 2 numbers in rad, one per joint"},
    {"/position_filter", R"({"noise": [1e-4]})",
     "position_filter.noise has 1 element: expected a list of 2 numbers in rad, one per joint"},
    {"/position_filter", R"({"noise": [1e-4, 0]})", "position_filter.noise[2] = 0: expected 1e-06 to 1000 rad"},
    {"/position_filter", R"({"noise": [1e-4, 1e-4], "jerk_density": 0})",
     "position_filter.jerk_density = 0: expected above 0 and at most 1e+09 rad2/s5"},
    {"/position_filter", R"({"noise": [1e-4, 1e-4], "jerk": 1})",
     "position_filter.jerk: unknown key; expected one of noise, jerk_density"},
    {"/bias/drift_variance", "-1e-6", "bias.drift_variance = -1e-06: expected 0 to 1e+09"},
    {"/bias/forget_rate", "-5", "bias.forget_rate = -5: expected 0 to 1e+09 1/s"},
    {"/contact/threshold/1", "-0.1", "contact.threshold[2] = -0.1: expected 0 to 1e+09 N.m"},
    {"/contact/threshold_per_force/0", "-1", "contact.threshold_per_force[1] = -1: expected 0 to 1e+09 m"},
    {"/tendons/1/moment_arms", "[0.018, 0.008]", "tendons: moment_arms are not of full column rank"},
};
INSTANTIATE_TEST_SUITE_P(Ranges, Refused, testing::ValuesIn(ranges));

// One extension of the small finger, which has two joints and two tendons; or several.
const std::vector<Fault> extensions = {
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
    {"/extensions/0", R"({"effect": "joint_coupling", "stiffness": 0.1})",
     "extensions[1].joint: missing; expected a joint from 1 to 1"},
    {"/extensions/0", R"({"effect": "backlash", "width": 0.1})",
     "extensions[1].joint: missing; expected a joint from 1 to 2, or tendon in its place"},
    {"/extensions/0", R"({"effect": "presliding", "joint": 1, "tendon": 1, "displacement": 0.1})",
     "extensions[1].tendon: not allowed beside joint; presliding acts at one of them"},
    {"/extensions/0", R"({"effect": "friction_drift", "joint": 1, "tendon": 1, "amplitude": 0, "time_constant": 1})",
     "extensions[1].tendon: not allowed beside joint"},
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
    {"/extensions/0", R"({"effect": "time_delay", "tendon": 1, "delay": 0})",
     "extensions[1].tendon: unknown key; expected one of effect, delay"},
    {"/extensions/0", R"({"effect": "time_delay", "delay": 0.06})",
     "extensions[1].delay = 0.06: expected -0.05 to 0.05 s"},
    {"/extensions", R"([{"effect": "time_delay", "delay": 0}, {"effect": "time_delay", "delay": 0.01}])",
     "extensions[2].effect = \"time_delay\": expected once, and extensions[1] is the same"},
    {"/extensions",
     R"([{"effect": "backlash", "tendon": 1, "width": 0}, {"effect": "backlash", "joint": 1, "width": 0},
         {"effect": "backlash", "tendon": 1, "width": 1}])",
     "extensions[3].effect = \"backlash\": expected once a place, and extensions[1] is the same"},
};
INSTANTIATE_TEST_SUITE_P(Extensions, Refused, testing::ValuesIn(extensions));

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
