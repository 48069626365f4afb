// Any bytes as a model image: refused in one line, or a finger that works. The mutator makes size and checksum fit
// again, since nothing behind them would be reached otherwise.
#include <cstdint>
#include <random>

#include "promises.h"

extern "C" {
#include "bytes.h"
#include "model_image.h"

std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);
}

namespace {

const std::uint32_t odd_words[] = {0,  1,  2,   3,   4,   8,          15,         16,         17,        31,
                                   63, 64, 255, 256, 257, 0x7fffffff, 0x80000000, 0x80000001, 0xffffffff};
const double odd_numbers[] = {0.0, -0.0, 5e-324, 1e-308, 1e-12, 1.0, -1.0, 1e9, 1e12, 1e300, -1e300, HUGE_VAL, NAN};

/* in place, so that the lengths still agree */
void change_a_word(std::uint8_t* data, std::size_t size, std::mt19937& random) {
  if (random() % 8 == 0) { /* an option */
    store_u32(data + 40, load_u32(data + 40) ^ 1u << random() % 18);
  } else if (random() % 2) {
    std::uint8_t* word = data + 32 + 4 * (random() % ((size - 32) / 4));
    const std::uint32_t odd = odd_words[random() % std::size(odd_words)];
    store_u32(word, random() % 2 ? odd : load_u32(word) + (random() % 2 ? 1 : 0xffffffffu));
  } else {
    std::uint8_t* number = data + 8 * (4 + random() % (size / 8 - 4));
    const double factor = std::ldexp(1.0, static_cast<int>(random() % 80) - 40);
    const double odd = odd_numbers[random() % std::size(odd_numbers)];
    store_f64(number, random() % 2 ? odd : load_f64(number) * factor);
  }
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  std::mt19937 random(seed);
  if (size >= MODEL_HEADER_BYTES + 8 && random() % 4) {
    for (unsigned i = 0; i < 1 + random() % 4; ++i) {
      change_a_word(data, size, random);
    }
  } else {
    size = LLVMFuzzerMutate(data, size, max_size);
  }
  if (size >= MODEL_HEADER_BYTES && random() % 16) {
    std::memcpy(data, "TFMUIMG", 8);
    store_u32(data + 8, MODEL_VERSION);
    store_u64(data + 16, size);
    store_u64(data + 24, hash_bytes(data + 32, size - 32, 0));
  }
  return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const promises::byte_list image(data, data + size);
  if (size == 0) {
    return 0;
  }
  char message[400] = "";
  const std::size_t memory = tendonfmu_memory_size(image.data(), size);
  const tendonfmu_status status = tendonfmu_check_image(image.data(), size, message, sizeof message);
  PROMISE((status == TENDONFMU_OK) == (memory > 0));
  PROMISE((status == TENDONFMU_OK) == (std::strlen(message) == 0));
  promises::finger_can_be_used(image);
  return 0;
}
