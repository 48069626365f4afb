// A finger and its samples, as `python -m evidence speed.steps` writes them: NAME.json, and NAME.samples with doubles,
// row by row: time, force of each tendon, position of each tendon.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tendonfmu.h"
#include "tendonfmu_description.h"

struct bench_case {
  std::vector<unsigned char> image;
  std::size_t tendons = 0, samples = 0;
  std::vector<double> time, input;  // a sample of input: forces, positions

  tendonfmu_inputs inputs(std::size_t sample) const {
    const double* row = &input[sample * 2 * tendons];
    return {row, row + tendons, nullptr, nullptr};
  }
};

inline std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline bench_case read_case(const std::filesystem::path& description) {
  bench_case made;
  const std::string json = content_of(description);
  void* block = nullptr;
  std::size_t size = 0;
  char message[400];
  if (tendonfmu_image_from_json(json.data(), json.size(), &block, &size, message, sizeof message) != TENDONFMU_OK) {
    std::fprintf(stderr, "%s: %s\n", description.c_str(), message);
    std::exit(2);
  }
  const auto* bytes = static_cast<const unsigned char*>(block);
  made.image.assign(bytes, bytes + size);
  tendonfmu_free_image(block);
  tendonfmu_finger* finger = tendonfmu_create(made.image.data(), made.image.size(), message, sizeof message);
  made.tendons = tendonfmu_tendon_count(finger);
  tendonfmu_destroy(finger);

  std::ifstream samples(std::filesystem::path(description).replace_extension(".samples"), std::ios::binary);
  std::vector<double> row(1 + 2 * made.tendons);
  while (samples.read(reinterpret_cast<char*>(row.data()), static_cast<std::streamsize>(row.size() * sizeof(double)))) {
    made.time.push_back(row[0]);
    made.input.insert(made.input.end(), row.begin() + 1, row.end());
  }
  made.samples = made.time.size();
  return made;
}
