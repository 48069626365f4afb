/* A view of an array that somebody else owns: what std::span is in C++20, for C++17.
 *
 * It is the same type under both standards, so that parts of a program that are compiled by different ones fit
 * together, and converts from and to std::span by itself. */
#ifndef TENDONFMU_SPAN_HPP
#define TENDONFMU_SPAN_HPP

#include <cstddef>
#include <iterator>
#include <type_traits>
#include <utility>

#if __cplusplus >= 202002L && __has_include(<span>)
#include <span>
#endif

namespace tendonfmu {

namespace detail {

// A temporary counts as const: a container then gives const elements, and a view those that it views.
template <typename Range>
using argument = std::conditional_t<std::is_lvalue_reference_v<Range>, Range, const std::remove_reference_t<Range>&>;

template <typename Range>
using element = std::remove_pointer_t<decltype(std::data(std::declval<argument<Range>>()))>;

template <typename Range, typename T, typename = void>
struct gives : std::false_type {};

// (*)[]: only const may be added. An array of derived objects is no array of base objects.
template <typename Range, typename T>
struct gives<Range, T, std::void_t<element<Range>, decltype(std::size(std::declval<argument<Range>>()))>>
    : std::is_convertible<element<Range> (*)[], T (*)[]> {};

}  // namespace detail

/* [size()] elements from data() on. Copying it copies no element. */
template <typename T>
class span {
 public:
  using element_type = T;
  using value_type = std::remove_cv_t<T>;
  using size_type = std::size_t;
  using iterator = T*;

  constexpr span() noexcept = default;
  constexpr span(T* data, std::size_t size) noexcept : data_(data), size_(size) {}

  /* An array, std::array, std::vector, std::span or whatever else has data() and size(). Of a temporary container
   * only a span of const elements: for an argument of a call, which the temporary outlives. */
  template <typename Range,
            typename = std::enable_if_t<!std::is_same_v<std::decay_t<Range>, span> && detail::gives<Range, T>::value>>
  constexpr span(Range&& range) noexcept : data_(std::data(range)), size_(std::size(range)) {}

  constexpr T* data() const noexcept { return data_; }
  constexpr std::size_t size() const noexcept { return size_; }
  constexpr bool empty() const noexcept { return size_ == 0; }
  constexpr T& operator[](std::size_t index) const noexcept { return data_[index]; }
  constexpr T* begin() const noexcept { return data_; }
  constexpr T* end() const noexcept { return data_ + size_; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

template <typename T>
span(T*, std::size_t) -> span<T>;
template <typename Range>
span(Range&&) -> span<detail::element<Range>>;

/* One number or flag as a span of size 1. */
template <typename T>
constexpr span<T> one(T& value) noexcept {
  return span<T>(&value, 1);
}

}  // namespace tendonfmu

#if defined(__cpp_lib_span)
template <typename T>
inline constexpr bool std::ranges::enable_borrowed_range<tendonfmu::span<T>> = true;
template <typename T>
inline constexpr bool std::ranges::enable_view<tendonfmu::span<T>> = true;
#endif

#endif
