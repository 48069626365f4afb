/* The C interface, tendonfmu_description.h: parse, read the shape, read the numbers, check, write. */
#include <cstdlib>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "core_inside.h"
#include "description_error.h"
#include "json_document.h"
#include "json_node.h"
#include "shape_reader.h"
#include "tendonfmu_description.h"

namespace tendonfmu {
namespace {

/* Value of a number that is left out, where it may be. */
std::optional<double> default_value(const model_item& item, std::uint32_t offset) {
  if (item.kind != ITEM_EXTENSION) {
    const key_row* row = key_row_of(item.kind, offset);
    return row->has_default ? std::optional<double>(row->default_value) : std::nullopt;
  }
  const effect_parameter& number = item.effect->parameters[offset];
  return number.required ? std::nullopt : std::optional<double>(number.missing_value);
}

double read_value(const json_node& document, const model_item& item, std::uint32_t index) {
  char path[PARAMETER_PATH_BYTES];
  parameter_path(&item, index, path);
  const json_node node = document.find(path);
  if (node.value().is_number()) {
    return node.value().get<double>();
  }
  const std::optional<double> missing = default_value(item, index - item.first);
  if (node.absent() && missing) {
    return *missing;
  }
  char range[120] = "";
  parameter_say_range(&item, index, message_line{range, sizeof range});
  node.refuse("a number, " + std::string(range));
}

/* No exception may pass through the C code that calls visit(), so one is carried around it. */
struct reading {
  const json_node& document;
  std::vector<double> values;
  std::exception_ptr failure;
};

int visit(void* context, const model_item* item) {
  reading& r = *static_cast<reading*>(context);
  try {
    for (std::uint32_t i = item->first; i < item->first + item->count; ++i) {
      r.values[i] = read_value(r.document, *item, i);
    }
    return 0;
  } catch (...) {
    r.failure = std::current_exception();
    return -1;
  }
}

/* values of all parameters [parameter_count] in the core's order, each found in the document under the core's path for
 * it; defaults where it is absent. Not checked against the ranges. */
std::vector<double> read_values(const json_node& document, const model_shape& shape) {
  reading r{document, std::vector<double>(shape.parameter_count), nullptr};
  model_visit(&shape, visit, &r);
  if (r.failure) {
    std::rethrow_exception(r.failure);
  }
  return r.values;
}

}  // namespace
}  // namespace tendonfmu

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
