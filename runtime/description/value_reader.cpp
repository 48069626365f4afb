#include "value_reader.h"

#include <exception>
#include <optional>
#include <string>

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

}  // namespace

std::vector<double> read_values(const json_node& document, const model_shape& shape) {
  reading r{document, std::vector<double>(shape.parameter_count), nullptr};
  model_visit(&shape, visit, &r);
  if (r.failure) {
    std::rethrow_exception(r.failure);
  }
  return r.values;
}

}  // namespace tendonfmu
