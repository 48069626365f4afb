// make_seeds FOLDER DOCUMENT.json...: what the fuzzers begin with. Fingers of the tests and the given ones for
// fuzz_json and fuzz_image, the given rigs for fuzz_rig, any bytes for fuzz_calls, and keys.dict of all words in them.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "../tests/test_finger.h"

namespace {

using json_tree = nlohmann::json;

const char* const least_finger = R"({"format": "tendonfmu-finger-1", "name": "least", "joints": [{}],
  "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}], "contact": {"threshold": [0.03]}})";
const char* const placed_finger = R"({"format": "tendonfmu-finger-1", "name": "placed", "joints": [{}],
  "tendons": [{"stiffness": 4000, "moment_arms": [0.01]}], "contact": {"threshold": [0.03], "deviation": [0.002]},
  "links": [{"axis": [0, 1, 0.5], "offset": [0.04, 0, 0]}], "tip": [0.02, 0, 0]})";

void write(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file << bytes;
  if (!file.flush()) {
    std::fprintf(stderr, "make_seeds: cannot write %s\n", path.string().c_str());
    std::exit(1);
  }
}

// A seed for each effect alone, which is mutated more deeply, and one with forces taken late.
void add_extended_fingers(std::vector<json_tree>& documents) {
  json_tree late = json_tree::parse(test_finger::every_effect());
  for (json_tree& row : late.at("extensions")) {
    documents.push_back(json_tree::parse(test_finger::json));
    documents.back()["extensions"] = json_tree::array({row});
    if (row.contains("delay")) {
      row["delay"] = -0.004;
    }
  }
  documents.push_back(late);
}

// The rig, and again without one of its parts each: smaller ones are mutated more deeply.
void add_smaller_rigs(std::vector<json_tree>& documents, const json_tree& rig) {
  for (const char* part :
       {"/physics/friction", "/physics/wrist", "/physics/obstacle", "/physics/tendons", "/sensors"}) {
    const json_tree::json_pointer place(part);
    documents.push_back(rig);
    documents.back().at(place.parent_pointer()).erase(place.back());
  }
}

// all keys and texts of a document
void collect(const json_tree& value, std::set<std::string>& words) {
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

std::string any_bytes(unsigned seed, std::size_t size) {
  std::mt19937 random(seed);
  std::string bytes(size, 0);
  std::generate(bytes.begin(), bytes.end(), [&] { return static_cast<char>(random()); });
  return bytes;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "usage: make_seeds FOLDER DOCUMENT.json...\n");
    return 2;
  }
  const std::filesystem::path folder = arguments[1], corpus = folder / "corpus";
  std::vector<json_tree> documents;
  for (const std::string& finger :
       {std::string(test_finger::json), std::string(least_finger), std::string(placed_finger), test_finger::every_key(),
        test_finger::every_effect()}) {
    documents.push_back(json_tree::parse(finger));
  }
  add_extended_fingers(documents);
  for (int i = 2; i < count; ++i) {
    std::ifstream file(arguments[i], std::ios::binary);
    documents.push_back(json_tree::parse(file));
    if (documents.back().contains("physics")) {
      add_smaller_rigs(documents, json_tree(documents.back()));
    }
  }
  std::set<std::string> words = {"\"bands\"",     "\"noise\"",     "\"threshold\"",   "null", "true",
                                 "\"positive\":", "\"negative\":", "\"noise_time\":", "1e999"};
  for (std::size_t i = 0; i < documents.size(); ++i) {
    const std::string name = "document" + std::to_string(i), text = documents[i].dump();
    collect(documents[i], words);
    if (documents[i].contains("physics")) {
      write(corpus / "fuzz_rig" / name, text);
      continue;
    }
    const std::vector<unsigned char> image = test_finger::image(text);
    write(corpus / "fuzz_json" / name, text);
    write(corpus / "fuzz_image" / name, std::string(image.begin(), image.end()));
  }
  for (unsigned seed = 0; seed < 40; ++seed) {
    write(corpus / "fuzz_calls" / ("calls" + std::to_string(seed)), any_bytes(seed, 100 * (seed + 1)));
  }
  std::string dictionary;
  for (const std::string& word : words) {
    dictionary += json_tree(word).dump() + "\n";  // quoted
  }
  write(folder / "keys.dict", dictionary);
}
