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
  const std::vector<std::string> places = document_faults::places(finger);
  ASSERT_GT(places.size(), 70u);
  document_faults::expect_refused_everywhere(finger, places, [](const json& faulty) {
    const Reading reading = read(faulty);
    EXPECT_EQ(reading.status == TENDONFMU_OK, reading.message.empty());
    EXPECT_EQ(reading.status == TENDONFMU_OK, !reading.image.empty());
    return reading.message;
  });
}

// A small finger with the value at `pointer` replaced by `value` (JSON text); "" removes it. `message` goes on after
// the key path of the pointer, or names another one.
struct Fault {
  const char* pointer;
  const char* value;
  const char* message;
};

const char* const law = R"({"static": 0.03, "coulomb": 0.02, "stribeck_velocity": 0.005})";

TEST(Refusal, SaysWhatIsExpected) {
  const Fault faults[] = {
      // missing
      {"/format", "null", ": missing; expected \"tendonfmu-finger-1\""},
      {"/name", "null", ": missing; expected a text"},
      {"/joints", "null", ": missing; expected a list of 1 to 16 joints"},
      {"/tendons/1/stiffness", "null", ": missing; expected a number, above 0 and at most 1e+12 N/m"},
      {"/tendons/1/moment_arms", "null", ": missing; expected a list of 2 numbers in m"},
      {"/contact", "null", ": missing; expected an object"},
      {"/contact/method", "\"bands\"", "contact.bands: missing; expected a list of 4 objects"},
      {"/contact/method", "\"cusum\"", " = \"cusum\": expected one of \"paper\", \"bands\""},
      {"/contact/bands", "[]", "contact.bands: not allowed beside contact.method"},
      {"/contact/drift", "{}", "contact.drift: no longer a key; leave it out, or calibrate again"},
      {"/tendons/0/edge_friction/0/negative", "null", ": missing; expected an object"},
      {"/tendons/0/edge_friction/1/angles", "null", ": missing; expected a list of 1 to"},
      {"/tendons/0/edge_friction/1/laws", "null", ": missing; expected a list of 2 laws"},
      {"/extensions/0/effect", "null", ": missing"},
      {"/extensions/0/joint", "null", ": missing; expected a joint from 1 to 2"},
      {"/joints/1", "null", ": missing; expected an object"},
      // wrong types
      {"/format", "\"tendonfmu-finger-2\"", " = \"tendonfmu-finger-2\": expected \"tendonfmu-finger-1\""},
      {"/name", "\"\"", " = \"\": expected a name of 1 to 200 bytes"},
      {"/name", "\"a\\nb\"", " = \"a\\nb\": expected a name of 1 to 200 bytes without control characters"},
      {"/joints", R"([{"name": "knuckle"}])",
       "tendons[1].moment_arms has 2 elements: expected a list of 1 number in m"},
      {"/tendons/0/stiffness", "true", " = true: expected a number, above 0 and at most 1e+12 N/m"},
      {"/tendons/0/stiffness", "\"4000\"", " = \"4000\": expected a number"},
      {"/tendons/0/bidirectional", "1", " = 1: expected true or false"},
      {"/tendons/0/pulley_friction", "{}", " = {...}: expected a list of at most 2 laws"},
      {"/velocity_filter_cutoff", "[20]", " = [...]: expected a number, 0 to 1e+09 Hz"},
      {"/contact/threshold", "0.03", " = 0.03: expected a list of 2 numbers in N.m, one per joint"},
      {"/extensions", "{}", " = {...}: expected a list of at most 1024 extensions"},
      // unknown keys
      {"/joints/1/stiffnes", "1", ": unknown key; expected one of name, cover, friction, load_friction"},
      {"/joints/0/friction/angles", "[0]", ": unknown key"},
      {"/tendons/0/edge_friction/0/negative/positive", "1", ": unknown key"},
      {"/tendons/0/edge_friction/1/laws/1/laws", "[]", ": unknown key"},
      {"/extensions/0/tendon", "1", ": unknown key; expected one of effect, joint, stiffness"},
      // lengths
      {"/joints", "[]", " has 0 elements: expected a list of 1 to 16 joints"},
      {"/joints", "[{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}]", " has 17 elements: expected a list of 1"},
      {"/tendons", "[]", " has 0 elements: expected a list of 1 to 64 tendons"},
      {"/tendons/0/moment_arms", "[0.009]", " has 1 element: expected a list of 2 numbers in m"},
      {"/tendons/0/pulley_friction", "[null, null, null]", " has 3 elements: expected a list of"},
      {"/tendons/0/edge_friction", "[null, null, null]", " has 3 elements: expected a list of at"},
      {"/tendons/0/edge_friction/1/angles", "[0, 1, 2]",
       "tendons[1].edge_friction[2].laws has 2 elements: expected a list of 3"},
      {"/tendons/0/edge_friction/1/angles", "[]", " has 0 elements: expected a list of"},
      {"/bias/initial_torque", "[0.1]", " has 1 element: expected a list of 2 numbers in N.m"},
      // contradictions
      {"/tendons/0/pulley_friction/1", law, " = {...}: expected null, since no joint comes"},
      {"/tendons/0/edge_friction/0/static", "1", ": not allowed beside positive and"},
      {"/tendons/0/edge_friction/1/static", "1", ": not allowed beside angles and laws"},
      {"/extensions/0/effect", "\"gravity\"",
       "extensions[1].stiffness: unknown key; expected one of effect, joint, sine"},
      {"/extensions/0/effect", "\"dragons\"", " = \"dragons\": expected one of cover_hardening, gravity,"},
      {"/extensions/0/effect", "\"gravity\\u0000\"", " = \"gravity"},
      {"/extensions/0/effect", "\"asymmetric_friction\"",
       " = \"asymmetric_friction\": no extension: it is a friction law with positive and negative"},
      {"/extensions/0/effect", "\"edge_friction\"",
       " = \"edge_friction\": no extension: it is the list edge_friction of a tendon"},
      {"/extensions/0/effect", "\"contact\"", " = \"contact\": no extension: it belongs to a recording"},
      {"/extensions/0/joint", "3", " = 3: expected a joint from 1 to 2"},
      {"/extensions/0/joint", "1.5", " = 1.5: expected a joint from 1 to 2"},
      {"/extensions/0/joint", "1e300", " = 1e+300: expected a joint from 1 to 2"},
      // ranges
      {"/joints/0/friction/viscous", "-0.001", " = -0.001: expected 0 to 1e+09 N.m.s/rad"},
      {"/joints/0/friction/stribeck_velocity", "0", " = 0: expected above 0 and at most 1e+09 rad/s"},
      {"/joints/0/friction/static", "0.005", " = 0.005: expected at least coulomb = 0.006"},
      {"/tendons/0/edge_friction/0/negative/static", "0.02", " = 0.02: expected at least coulomb = 0.03"},
      {"/tendons/0/stiffness", "0", " = 0: expected above 0 and at most 1e+12 N/m"},
      {"/tendons/0/stiffness", "1e300", " = 1e+300: expected above 0 and at most 1e+12 N/m"},
      {"/tendons/0/edge_friction/1/angles", "[0.5, 0.5]", "[2] = 0.5: expected above the angle before it, 0.5 rad"},
      {"/tendons/0/edge_friction/1/angles", "[0.5, -0.5]", "[2] = -0.5: expected above the angle before it, 0.5 rad"},
      {"/tendons/1/moment_arms", "[0.018, 0.008]", "tendons: moment_arms are not of full column rank"},
      // extensions that are there before
      {"/extensions",
       R"([{"effect": "presliding", "displacement": 1}, {"effect": "presliding", "joint": 1, "displacement": 1},
         {"effect": "presliding", "joint": null, "displacement": 2}, {"effect": "presliding", "displacement": 3}])",
       "[4].effect = \"presliding\": expected twice at most, and extensions[3] is the same"},
      {"/extensions", R"([{"effect": "time_delay", "delay": 0}, {"effect": "time_delay", "delay": 0.01}])",
       "[2].effect = \"time_delay\": expected once, and extensions[1] is the same"},
      {"/extensions",
       R"([{"effect": "backlash", "tendon": 1, "width": 0}, {"effect": "backlash", "joint": 1, "width": 0},
         {"effect": "backlash", "tendon": 1, "width": 1}])",
       "[3].effect = \"backlash\": expected once a place, and extensions[1] is the same"},
  };
  for (const Fault& fault : faults) {
    const json value = json::parse(fault.value);
    const std::string message = read(document_faults::changed(small_finger(), fault.pointer, value)).message;
    const bool is_of_the_place =
        *fault.message == ':' || *fault.message == ' ' || *fault.message == '.' || *fault.message == '[';
    const std::string expected = (is_of_the_place ? document_faults::path_of(fault.pointer) : "") + fault.message;
    EXPECT_EQ(message.find(expected), 0u) << fault.pointer << " = " << fault.value << ": " << message;
  }
}

TEST(Refusal, SaysWhatIsExpectedOfAnExtension) {
  const struct {
    const char *effect, *keys, *message;
  } faults[] = {
      {"force_gain", R"("correction": 0.1)", ".tendon: missing; expected a tendon from 1 to 2"},
      {"force_gain", R"("tendon": 3, "correction": 0.1)", ".tendon = 3: expected a tendon from 1 to 2"},
      {"force_gain", R"("tendon": 1, "joint": 1, "correction": 0.1)",
       ".joint: unknown key; expected one of effect, tendon, correction"},
      {"force_gain", R"("tendon": 1, "correction": -1)", ".correction = -1: expected above -1 and at most 1e+09 1"},
      {"moment_arm", R"("tendon": 1, "correction": 0.1)", ".joint: missing; expected a joint from 1 to 2"},
      {"preload_friction", R"("joint": 1, "coulomb": 0.1)", ".tendon: missing; expected a tendon from 1 to 2"},
      {"preload_friction", R"("tendon": 1, "joint": 0, "coulomb": 0.1)", ".joint = 0: expected a joint from 1 to 2"},
      {"joint_coupling", R"("joint": 2, "stiffness": 0.1)",
       ".joint = 2: expected a joint from 1 to 1, since the last one has none after it"},
      {"backlash", R"("width": 0.1)", ".joint: missing; expected a joint from 1 to 2, or tendon in its place"},
      {"presliding", R"("joint": 1, "level": 1, "displacement": 0.1)",
       ".level: not allowed beside joint or tendon; a level has all tendons"},
      {"presliding", R"("joint": 1, "displacement": -1)", ".displacement = -1: expected 0 to 1e+09 rad"},
      {"presliding", R"("joint": 1, "tendon": 1, "displacement": -1)", ".displacement = -1: expected 0 to 1e+09 m"},
      {"presliding", R"("displacement": -1)", ".displacement = -1: expected 0 to 1e+09 s"},
      {"presliding", R"("displacement": 0)", ".displacement = 0: expected above 0, here or in stiffness"},
      {"presliding", R"("displacement": 1, "stiffness": 2)", ".stiffness = 2: expected 0 beside displacement"},
      {"presliding", R"("displacement": 1, "share": 0)", ".share = 0: expected above 0 and at most 1e+09 1"},
      {"cord_stretch", R"("stiffness": 0.5)", ".stiffness = 0.5: expected 1 to 1e+12 N/m"},
      {"stribeck", R"("joint": 1, "amplitude": -1, "stribeck_velocity": 1)",
       ".amplitude = -1: expected -0.99 to 1e+09 1"},
      {"time_delay", R"("delay": 0.06)", ".delay = 0.06: expected -0.05 to 0.05 s"},
  };
  for (const auto& fault : faults) {
    json finger = small_finger();
    finger["extensions"][0] = json::parse(std::string("{") + fault.keys + "}");
    finger["extensions"][0]["effect"] = fault.effect;
    const std::string message = read(finger).message;
    EXPECT_EQ(message.find(std::string("extensions[1]") + fault.message), 0u) << fault.effect << ": " << message;
  }
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
