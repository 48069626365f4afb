// Descriptions that are accepted, and the numbers they stand for.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "described_finger.h"
#include "document_faults.h"
#include "model_inside.h"

using nlohmann::json;

namespace {

class Described {
 public:
  explicit Described(const json& description) : reading_(read(description)), finger_(checked(reading_)) {}

  double operator[](const char* path) {
    double value = NAN;
    tendonfmu_get_parameter(finger_, path, &value);
    return value;
  }
  bool has(const char* path) { return !std::isnan((*this)[path]); }
  tendonfmu_finger* handle() { return finger_; }

 private:
  static const std::vector<unsigned char>& checked(const Reading& reading) {
    EXPECT_EQ(reading.status, TENDONFMU_OK) << reading.message;
    EXPECT_EQ(reading.message, "");
    return reading.image;
  }

  Reading reading_;
  test_finger::Finger finger_;
};

json without(const char* pointer) {
  json finger = small_finger();
  const json::json_pointer at(pointer);
  finger[at.parent_pointer()].erase(at.back());
  return finger;
}

json with(const char* pointer, const json& value) {
  return document_faults::changed(small_finger(), pointer, value);
}

TEST(Description, EveryNumberArrivesUnderItsPath) {
  Described finger(small_finger());
  EXPECT_EQ(finger["joints[1].cover.stiffness"], 0.02);
  EXPECT_EQ(finger["joints[1].cover.rest_angle"], 0.1);
  EXPECT_EQ(finger["joints[1].load_friction.viscous"], 1e-6);
  EXPECT_EQ(finger["tendons[1].stiffness"], 4000.0);
  EXPECT_EQ(finger["tendons[2].moment_arms[2]"], 0.003);
  EXPECT_EQ(finger["tendons[1].pulley_friction[1].static"], 0.02);
  EXPECT_EQ(finger["tendons[1].edge_friction[1].positive.viscous"], 0.3);
  EXPECT_EQ(finger["tendons[1].edge_friction[1].negative.stribeck_velocity"], 0.006);
  EXPECT_EQ(finger["tendons[1].edge_friction[2].angles[1]"], -0.5);
  EXPECT_EQ(finger["tendons[1].edge_friction[2].laws[2].coulomb"], 0.04);
  EXPECT_EQ(finger["velocity_threshold.tendon"], 0.0004);
  EXPECT_EQ(finger["velocity_filter_cutoff"], 25.0);
  EXPECT_EQ(finger["bias.drift_variance"], 2e-6);
  EXPECT_EQ(finger["bias.initial_variance"], 1e-4);
  EXPECT_EQ(finger["bias.initial_torque[2]"], -0.2);
  EXPECT_EQ(finger["bias.noise_time"], 0.01);
  EXPECT_EQ(finger["contact.threshold_per_force[2]"], 2e-4);
  EXPECT_EQ(finger["extensions[1].stiffness"], 0.3);
}

TEST(Description, OptionalNumbersHaveDefaults) {
  Described finger(json::parse(R"({"format": "tendonfmu-finger-1", "name": "one", "joints": [{}],
    "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}], "contact": {"threshold": [0.03]}})"));
  EXPECT_EQ(finger["velocity_threshold.tendon"], 0.0005);
  EXPECT_EQ(finger["velocity_threshold.joint"], 0.01);
  EXPECT_EQ(finger["velocity_filter_cutoff"], 20.0);
  EXPECT_EQ(finger["bias.drift_variance"], 1e-6);
  EXPECT_EQ(finger["bias.noise_std"], 0.01);
  EXPECT_EQ(finger["bias.noise_std_per_force"], 0.0);
  EXPECT_EQ(finger["bias.forget_rate"], 5.0);
  EXPECT_EQ(finger["contact.threshold_per_force[1]"], 0.0);
  EXPECT_FALSE(finger.has("bias.initial_variance"));
  EXPECT_FALSE(finger.has("bias.initial_torque[1]"));
  EXPECT_FALSE(finger.has("bias.noise_time"));
  EXPECT_FALSE(finger.has("joints[1].cover.stiffness"));
  // stiffness, moment arm, 3 thresholds of velocity and filter, 4 of the bias, 2 of contact
  EXPECT_EQ(tendonfmu_parameter_count(finger.handle()), 11u);
  json more = small_finger();
  more["joints"][0]["cover"].erase("rest_angle");
  more["joints"][0]["friction"].erase("viscous");
  more["tendons"][0]["edge_friction"][0]["negative"].erase("viscous");
  Described described(more);
  EXPECT_EQ(described["joints[1].cover.rest_angle"], 0.0);
  EXPECT_EQ(described["joints[1].friction.viscous"], 0.0);
  EXPECT_EQ(described["tendons[1].edge_friction[1].negative.viscous"], 0.0);
}

// Both are the same finger: what is null, left out, or written in another way.
TEST(Description, MayBeWrittenInSeveralWays) {
  for (const char* optional : {"/joints/0/name",
                               "/joints/0/cover",
                               "/joints/0/cover/rest_angle",
                               "/joints/0/friction",
                               "/joints/0/friction/viscous",
                               "/joints/0/load_friction",
                               "/tendons/0/name",
                               "/tendons/0/bidirectional",
                               "/tendons/0/pulley_friction",
                               "/tendons/0/edge_friction",
                               "/velocity_threshold",
                               "/velocity_threshold/tendon",
                               "/velocity_threshold/joint",
                               "/velocity_filter_cutoff",
                               "/bias",
                               "/bias/drift_variance",
                               "/bias/noise_std",
                               "/bias/noise_std_per_force",
                               "/bias/initial_variance",
                               "/bias/forget_rate",
                               "/bias/initial_torque",
                               "/bias/noise_time",
                               "/contact/threshold_per_force",
                               "/extensions"}) {
    const Reading absent = read(without(optional)), null = read(with(optional, nullptr));
    EXPECT_EQ(absent.status, TENDONFMU_OK) << optional << ": " << absent.message;
    EXPECT_EQ(null.image, absent.image) << optional;
  }
  const std::vector<unsigned char> image = read(small_finger()).image;
  EXPECT_EQ(read(without("/tendons/0/bidirectional")).image, image);
  EXPECT_NE(read(with("/tendons/0/bidirectional", true)).image, image);
  EXPECT_EQ(read(with("/name", "Zeigefinger – 人差し指 \"100 %\"")).image, image);
  EXPECT_EQ(read(with("/joints/1/name", "tip")).image, image);
  EXPECT_EQ(read(with("/tendons/0/stiffness", 4000.0)).image, image);
  EXPECT_EQ(read(with("/extensions/0/joint", 2.0)).image, image);
  EXPECT_EQ(read("\r\n\t" + small_finger().dump(7) + "\n").image, image);
  EXPECT_EQ(read("\xef\xbb\xbf" + small_finger().dump()).image, image); /* a byte order mark */
}

// null beside the other form of a law, short lists of laws, forms that are mixed
TEST(Description, LawsMayBeWrittenInSeveralWays) {
  json finger = small_finger(), padded = small_finger();
  json& edges = padded["tendons"][0]["edge_friction"];
  edges[0]["static"] = edges[0]["angles"] = edges[1]["positive"] = edges[1]["laws"][0]["negative"] = nullptr;
  padded["tendons"][1]["edge_friction"] = json::array();
  padded["tendons"][1]["pulley_friction"] = {nullptr, nullptr};
  EXPECT_EQ(read(padded).image, read(finger).image);
  padded["tendons"][0]["pulley_friction"].erase(1);
  EXPECT_EQ(read(padded).image, read(finger).image);
  finger["tendons"][0]["edge_friction"][1]["laws"][1] = finger["tendons"][0]["edge_friction"][0];
  EXPECT_EQ(Described(finger)["tendons[1].edge_friction[2].laws[2].negative.static"], 0.04);
}

TEST(Description, TakesNumbersAtTheEndsOfTheirRanges) {
  for (const char* number : {"/bias/drift_variance", "/bias/initial_variance", "/bias/forget_rate", "/bias/noise_std",
                             "/bias/noise_std_per_force", "/velocity_filter_cutoff", "/velocity_threshold/tendon",
                             "/velocity_threshold/joint", "/contact/threshold/0", "/joints/0/cover/stiffness",
                             "/joints/0/friction/viscous", "/tendons/0/moment_arms/1"}) {
    EXPECT_EQ(read(with(number, 0)).message, "") << number;
  }
  EXPECT_EQ(read(with("/joints/0/friction/static", 0.006)).message, "") << "that of coulomb";
  const json law = {{"static", 0.03}, {"coulomb", 0.02}, {"stribeck_velocity", 0.005}};
  Described finger(with("/tendons/1/edge_friction", {{{"angles", {0.2}}, {"laws", {law}}}}));
  EXPECT_EQ(finger["tendons[2].edge_friction[1].laws[1].static"], 0.03) << "one working point";
}

json largest_finger() {
  json finger = small_finger();
  const json law = {{"static", 0.03}, {"coulomb", 0.02}, {"stribeck_velocity", 0.005}};
  finger["joints"] = json(16, json::object());
  finger["tendons"] = json::array();
  for (int i = 0; i < 64; ++i) {
    json tendon = {{"stiffness", 4000}, {"moment_arms", json(16, 0.0)}, {"edge_friction", json(16, law)}};
    tendon["moment_arms"][static_cast<std::size_t>(i % 16)] = i % 32 < 16 ? 0.01 : -0.01;
    finger["tendons"].push_back(tendon);
  }
  finger["contact"] = {{"threshold", json(16, 0.03)}};
  finger["bias"].erase("initial_torque");
  return finger;
}

TEST(Description, SixteenJointsAndSixtyFourTendonsAreAllowed) {
  Described finger(largest_finger());
  EXPECT_EQ(tendonfmu_joint_count(finger.handle()), 16u);
  EXPECT_EQ(tendonfmu_tendon_count(finger.handle()), 64u);
  EXPECT_EQ(finger["tendons[64].edge_friction[16].static"], 0.03);
}

TEST(Extensions, PreslidingEverywhereMultipliesThresholds) {
  for (const char* key : {"tendon", "joint"}) {
    nlohmann::json finger = small_finger();
    finger["extensions"] = nlohmann::json::parse(R"([{"effect": "presliding", "joint": 1, "displacement": 0.01}])");
    finger["velocity_threshold"][key] = 0;
    EXPECT_EQ(read(finger).message, "");
    finger["extensions"].push_back({{"effect", "presliding"}, {"displacement", 0.02}});
    const std::string unit = std::string(key) == "tendon" ? "m/s" : "rad/s";
    EXPECT_EQ(read(finger).message, std::string("velocity_threshold.") + key + " = 0: expected above 0 " + unit +
                                        ", since extensions[2], presliding without joint or tendon, multiplies it");
  }
}

TEST(Extensions, HasRoomForAThousandExtensions) {
  nlohmann::json finger = small_finger();
  const nlohmann::json one = finger["extensions"][0];
  finger["extensions"] = nlohmann::json::array();
  for (int k = 0; k < 1024; ++k) {
    finger["extensions"].push_back(one);
  }
  EXPECT_EQ(read(finger).message, "");
  finger["extensions"].push_back(one);
  EXPECT_EQ(read(finger).message, "extensions has 1025 elements: expected a list of at most 1024 extensions");
}

}  // namespace
