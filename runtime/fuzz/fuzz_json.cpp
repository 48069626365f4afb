// Any bytes as a description: refused in one printable line, or an image of a finger that works.
#include <cstdint>
#include <string>

#include "promises.h"
#include "tendonfmu_description.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  void* block = nullptr;
  std::size_t block_size = 0;
  char message[400] = "";
  const tendonfmu_status status =
      tendonfmu_image_from_json(text.data(), size, &block, &block_size, message, sizeof message);
  PROMISE((status == TENDONFMU_OK) == (block != nullptr));
  if (!block) {
    promises::is_one_line(message);
  } else {
    const auto* bytes = static_cast<const unsigned char*>(block);
    const promises::byte_list image(bytes, bytes + block_size);
    PROMISE(tendonfmu_check_image(image.data(), image.size(), message, sizeof message) == TENDONFMU_OK);
    tendonfmu_finger* finger = tendonfmu_create(image.data(), image.size(), nullptr, 0);
    PROMISE(finger != nullptr); /* what the reader accepts, the core accepts */
    tendonfmu_destroy(finger);
    promises::finger_can_be_used(image);
  }
  tendonfmu_free_image(block);
  return 0;
}
