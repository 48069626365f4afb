// A model image taken apart, for the tests of the core's inside.
#pragma once

#include <cstdint>
#include <vector>

#include "core_inside.h"
#include "test_finger.h"

struct Model {
  model_shape shape{};
  std::vector<std::uint32_t> words;
  std::vector<double> values;
  char message[400] = "";
  bool accepted;

  explicit Model(const std::vector<unsigned char>& image) {
    const message_line line = {message, sizeof message};
    accepted = model_read_header(image.data(), image.size(), &shape, line) == 0;
    if (accepted) {
      words.resize(shape.word_count + std::size_t{MODEL_EXTENSION_WORDS} * shape.extension_count);
      values.resize(shape.parameter_count);
      accepted = model_read_body(image.data(), &shape, words.data(), values.data(), line) == 0;
    }
  }
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  std::vector<unsigned char> written() const {
    std::vector<unsigned char> image(model_image_size(&shape));
    model_write(&shape, values.data(), image.data());
    return image;
  }
};

// Makes the checksum of an image fit its content again.
inline void seal(std::vector<unsigned char>& image) {
  store_u64(image.data() + 24, hash_bytes(image.data() + 32, image.size() - 32, 0));
}
