#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "signal_source.hpp"

namespace {

std::vector<std::string> split(std::string line) {
  line.erase(std::remove(line.begin(), line.end(), '\r'), line.end());
  std::vector<std::string> parts;
  std::stringstream stream(line);
  for (std::string part; std::getline(stream, part, ',');) {
    parts.push_back(part);
  }
  return parts;
}

class csv : public signal_source {
 public:
  csv(const std::string& path, std::size_t tendons) : path_(path), tendons_(tendons) {
    std::ifstream file(path);
    std::string line;
    if (!std::getline(file, line)) {
      throw std::runtime_error(path + ": cannot read it, or it is empty");
    }
    const std::vector<std::size_t> columns = find_columns(split(line));
    for (std::size_t row = 1; std::getline(file, line); ++row) {
      const std::vector<std::string> cells = split(line);
      for (const std::size_t column : columns) {
        numbers_.push_back(number(cells, column, row));
      }
    }
  }

  bool read(sample& next) noexcept override {
    const double* row = numbers_.data() + at_;
    if (at_ == numbers_.size()) {
      return false;
    }
    next = {row[0] - numbers_[0], {row + 1, tendons_}, {row + 1 + tendons_, tendons_}};
    at_ += 1 + 2 * tendons_;
    return true;
  }

 private:
  // of time, the forces and the positions, in this order
  std::vector<std::size_t> find_columns(const std::vector<std::string>& names) const {
    std::vector<std::string> wanted = {"time"};
    for (const char* quantity : {"tendon_force[", "tendon_position["}) {
      for (std::size_t i = 1; i <= tendons_; ++i) {
        wanted.push_back(quantity + std::to_string(i) + "]");
      }
    }
    std::vector<std::size_t> columns;
    for (const std::string& name : wanted) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end()) {
        throw std::runtime_error(path_ + ": no column " + name);
      }
      columns.push_back(static_cast<std::size_t>(found - names.begin()));
    }
    return columns;
  }

  double number(const std::vector<std::string>& cells, std::size_t column, std::size_t row) const {
    char* end = nullptr;
    const char* text = column < cells.size() ? cells[column].c_str() : "";
    const double value = std::strtod(text, &end);
    if (end == text || *end != 0) {
      throw std::runtime_error(path_ + ": row " + std::to_string(row) + ", column " + std::to_string(column + 1) +
                               ": \"" + text + "\": expected a number");
    }
    return value;
  }

  std::string path_;
  std::size_t tendons_;
  std::vector<double> numbers_;  // rows of 1 + 2 m
  std::size_t at_ = 0;
};

}  // namespace

std::unique_ptr<signal_source> recording(const std::string& path, std::size_t tendons) {
  return std::make_unique<csv>(path, tendons);
}
