/* The C interface, tendonfmu_description.h: parse, read the shape, read the numbers, check, write. */
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <vector>

#include "core_inside.h"
#include "description_error.h"
#include "json_document.h"
#include "json_node.h"
#include "shape_reader.h"
#include "tendonfmu_description.h"
#include "value_reader.h"

namespace {

struct free_block {
  void operator()(void* block) const { std::free(block); }
};
using image_block = std::unique_ptr<void, free_block>;

image_block make_image(const char* text, std::size_t text_size, std::size_t* size) {
  using namespace tendonfmu;
  const json document = parse_document(text, text_size);
  const json_node root(document);
  const finger_shape finger = read_shape(root);
  const std::vector<double> values = read_values(root, finger.shape);
  char reason[400];
  if (parameter_check_all(&finger.shape, values.data(), message_line{reason, sizeof reason})) {
    throw description_error(reason);
  }
  *size = model_image_size(&finger.shape);
  image_block image(std::malloc(*size));
  if (!image) {
    throw std::bad_alloc();
  }
  model_write(&finger.shape, values.data(), image.get());
  return image;
}

}  // namespace

tendonfmu_status tendonfmu_image_from_json(const char* json, size_t json_size, void** image, size_t* image_size,
                                           char* message, size_t message_size) {
  if (!json || !image || !image_size || (!message && message_size)) {
    return TENDONFMU_BAD_ARGUMENT;
  }
  *image = nullptr;
  *image_size = 0;
  tendonfmu::copy_line("", message, message_size);
  try {
    std::size_t size = 0;
    *image = make_image(json, json_size, &size).release();
    *image_size = size;
    return TENDONFMU_OK;
  } catch (const std::bad_alloc&) {
    tendonfmu::copy_line("out of memory for this description", message, message_size);
  } catch (const std::exception& error) {
    tendonfmu::copy_line(error.what(), message, message_size);
  } catch (...) {
    tendonfmu::copy_line("description refused for an unknown reason", message, message_size);
  }
  return TENDONFMU_BAD_IMAGE;
}

void tendonfmu_free_image(void* image) {
  std::free(image);
}
