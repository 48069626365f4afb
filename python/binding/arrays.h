// What the modules share: numpy arrays in and out, and handles of the C interfaces.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace nb = nanobind;

using number_rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using number_row = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using flag_row = nb::ndarray<const unsigned char, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using flag_rows = nb::ndarray<const unsigned char, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// What a module refuses; a module shows it as a ValueError of its own.
struct refusal : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

// Values as a numpy array of this shape; empty: of one dimension. Shown: their type in numpy, such as bool.
template <typename Value, typename Shown = Value>
nb::object as_array(std::vector<Value> values, std::vector<std::size_t> shape = {}) {
  if (shape.empty()) {
    shape = {values.size()};
  }
  auto* kept = new std::vector<Value>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Value>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, Shown>(kept->data(), shape.size(), shape.data(), owner));
}

// A new numpy array of zeros, and its values.
template <typename Value, typename Shown = Value>
std::pair<nb::object, Value*> new_array(const std::vector<std::size_t>& shape) {
  std::vector<Value> values(std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>()));
  Value* data = values.data();
  return {as_array<Value, Shown>(std::move(values), shape), data};
}

// The array of this name in a mapping, in the type and order that Array says; none where it is absent or None.
template <typename Array>
std::optional<Array> array_in(const nb::object& arrays, const char* name) {
  const nb::object given = arrays.attr("get")(name);
  Array array;
  if (given.is_none()) {
    return std::nullopt;
  }
  if (!nb::try_cast(given, array)) {
    throw refusal(std::string(name) + ": expected a numpy array of samples");
  }
  return array;
}

// What tendonfmu_<thing>_create() gave. create(message, message_size) calls it; its refusal is a refusal.
template <typename Handle, void (*destroy)(Handle*), const char* (*last_error)(const Handle*)>
class bound_handle {
 public:
  template <typename Create>
  explicit bound_handle(const Create& create) {
    char message[600] = "";
    handle_.reset(create(message, sizeof message));
    if (!handle_) {
      throw refusal(message);
    }
  }
  Handle* get() const { return handle_.get(); }
  std::string reason() const {
    const std::string line = last_error(get());
    return line.empty() ? "bad argument" : line;
  }
  // Refuses with the reason, unless the status is OK, which is 0.
  template <typename Status>
  void expect(Status status) const {
    if (status != Status{}) {
      throw refusal(reason());
    }
  }

 private:
  struct deleter {
    void operator()(Handle* handle) const { destroy(handle); }
  };
  std::unique_ptr<Handle, deleter> handle_;
};
