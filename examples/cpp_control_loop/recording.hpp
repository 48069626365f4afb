// Where the samples of the loop come from: a recording. Your drivers take the place of this class.
#pragma once

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tendonfmu.hpp>
#include <vector>

struct sample {
  double time = 0.0;                       // s, from 0
  tendonfmu::span<const double> force;     // [m] N
  tendonfmu::span<const double> position;  // [m] m, motor side
};

class recording {
 public:
  // A CSV file with the columns time, tendon_force[i] and tendon_position[i] (docs/reference/recordings.md), read as a
  // whole. Others are passed over. Throws std::runtime_error: file, row, what was expected.
  recording(const std::string& path, std::size_t tendons) : tendons_(tendons) {
    std::ifstream file(path);
    std::string line;
    if (!std::getline(file, line)) {
      throw std::runtime_error(path + ": cannot read it, or it is empty");
    }
    std::vector<std::size_t> columns;
    const std::vector<std::string> names = split(line);
    for (const std::string& name : wanted(tendons)) {
      columns.push_back(static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin()));
      if (columns.back() == names.size()) {
        throw std::runtime_error(path + ": no column " + name);
      }
    }
    for (std::size_t row = 1; std::getline(file, line); ++row) {
      const std::vector<std::string> cells = split(line);
      for (const std::size_t column : columns) {
        char* end = nullptr;
        const char* text = column < cells.size() ? cells[column].c_str() : "";
        numbers_.push_back(std::strtod(text, &end));
        if (end == text || *end != 0) {
          throw std::runtime_error(path + ": row " + std::to_string(row) + ", column " + std::to_string(column + 1) +
                                   ": \"" + text + "\": expected a number");
        }
      }
    }
  }

  // The next sample, valid until the next call; false when there is none. Allocates nothing.
  bool read(sample& next) noexcept {
    if (at_ == numbers_.size()) {
      return false;
    }
    const double* row = numbers_.data() + at_;
    next = {row[0] - numbers_[0], {row + 1, tendons_}, {row + 1 + tendons_, tendons_}};
    at_ += 1 + 2 * tendons_;
    return true;
  }

 private:
  static std::vector<std::string> split(std::string line) {
    line.erase(std::remove(line.begin(), line.end(), '\r'), line.end());
    std::vector<std::string> parts;
    std::stringstream stream(line);
    for (std::string part; std::getline(stream, part, ',');) {
      parts.push_back(part);
    }
    return parts;
  }

  static std::vector<std::string> wanted(std::size_t tendons) {
    std::vector<std::string> names = {"time"};
    for (const char* quantity : {"tendon_force[", "tendon_position["}) {
      for (std::size_t i = 1; i <= tendons; ++i) {
        names.push_back(quantity + std::to_string(i) + "]");
      }
    }
    return names;
  }

  std::size_t tendons_;
  std::vector<double> numbers_;  // rows of 1 + 2 m
  std::size_t at_ = 0;
};
