// make_seeds FOLDER DOCUMENT.json...: writes what the fuzzers begin with: corpus/fuzz_json, corpus/fuzz_image and
// keys.dict from the given fingers, the one of the tests and a least one; corpus/fuzz_rig from the given rigs;
// corpus/fuzz_calls, where any bytes are a sequence of calls.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "../tests/test_finger.h"

namespace {

const char* const least_finger = R"({"format": "tendonfmu-finger-1", "name": "least", "joints": [{}],
  "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}], "contact": {"threshold": [0.03]}})";

void write(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  if (!file.flush()) {
    std::fprintf(stderr, "make_seeds: cannot write %s\n", path.string().c_str());
    std::exit(1);
  }
}

// the same, with link geometry and what is known of its torques
std::string placed_finger() {
  nlohmann::json finger = nlohmann::json::parse(least_finger);
  const std::size_t joints = finger.at("joints").size();
  finger["links"] = nlohmann::json(joints, nlohmann::json{{"axis", {0.0, 1.0, 0.5}}, {"offset", {0.04, 0.0, 0.0}}});
  finger["tip"] = {0.02, 0.0, 0.0};
  finger["contact"]["deviation"] = std::vector<double>(joints, 0.002);
  return finger.dump();
}

// a seed for each effect alone, which is mutated more deeply, one with all of them, and one with forces taken late
std::vector<std::string> extended_fingers() {
  const nlohmann::json every = nlohmann::json::parse(test_finger::every_effect());
  nlohmann::json late = every;
  std::vector<std::string> fingers = {every.dump()};
  for (nlohmann::json& row : late.at("extensions")) {
    nlohmann::json alone = nlohmann::json::parse(test_finger::json);
    alone["extensions"] = nlohmann::json::array({row});
    fingers.push_back(alone.dump());
    if (row.contains("delay")) {
      row["delay"] = -0.004;
    }
  }
  fingers.push_back(late.dump());
  return fingers;
}

// all keys and texts of a description
void collect(const nlohmann::json& value, std::set<std::string>& words) {
  if (value.is_string()) {
    words.insert(value.dump());
  }
  for (auto item = value.begin(); value.is_structured() && item != value.end(); ++item) {
    if (value.is_object()) {
      words.insert("\"" + item.key() + "\":");
    }
    collect(*item, words);
  }
}

std::string quoted(const std::string& word) {
  std::string text = "\"";
  for (const char c : word) {
    text += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  }
  return text + "\"\n";
}

// a rig, and again without one of its parts each: smaller ones are mutated more deeply
void write_rigs(const std::filesystem::path& folder, const nlohmann::json& rig) {
  write(folder / "whole", rig.dump());
  for (const char* part :
       {"/physics/friction", "/physics/wrist", "/physics/obstacle", "/physics/tendons", "/sensors"}) {
    const nlohmann::json::json_pointer place(part);
    nlohmann::json less = rig;
    less.at(place.parent_pointer()).erase(place.back());
    std::string name = part;
    std::replace(name.begin(), name.end(), '/', '_');
    write(folder / ("without" + name), less.dump());
  }
}

std::string any_bytes(unsigned seed, std::size_t size) {
  std::mt19937 random(seed);
  std::string bytes(size, 0);
  for (char& c : bytes) {
    c = static_cast<char>(random());
  }
  return bytes;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "usage: make_seeds FOLDER DOCUMENT.json...\n");
    return 2;
  }
  std::vector<std::string> fingers = {test_finger::json, least_finger, placed_finger(), test_finger::every_key()};
  for (const std::string& finger : extended_fingers()) {
    fingers.push_back(finger);
  }
  for (int i = 2; i < count; ++i) {
    std::ifstream file(arguments[i], std::ios::binary);
    fingers.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  const std::filesystem::path folder = arguments[1];
  std::filesystem::create_directories(folder / "corpus" / "fuzz_json");
  std::filesystem::create_directories(folder / "corpus" / "fuzz_image");
  std::filesystem::create_directories(folder / "corpus" / "fuzz_calls");
  std::filesystem::create_directories(folder / "corpus" / "fuzz_rig");
  for (unsigned seed = 0; seed < 40; ++seed) {
    write(folder / "corpus" / "fuzz_calls" / ("calls" + std::to_string(seed)), any_bytes(seed, 100 * (seed + 1)));
  }
  std::set<std::string> words = {"\"innovation\"", "\"time\"",      "\"threshold\"",   "null", "true",
                                 "\"positive\":",  "\"negative\":", "\"noise_time\":", "1e999"};
  for (std::size_t i = 0; i < fingers.size(); ++i) {
    const std::string name = "finger" + std::to_string(i);
    const auto document = nlohmann::json::parse(fingers[i]);
    if (document.at("format") != "tendonfmu-finger-1") {
      write_rigs(folder / "corpus" / "fuzz_rig", document);
      collect(document, words);
      continue;
    }
    const std::vector<unsigned char> image = test_finger::image(fingers[i]);
    write(folder / "corpus" / "fuzz_json" / name, document.dump());
    write(folder / "corpus" / "fuzz_image" / name, std::string(image.begin(), image.end()));
    collect(document, words);
  }
  std::string dictionary;
  for (const std::string& word : words) {
    dictionary += quoted(word);
  }
  write(folder / "keys.dict", dictionary);
}
