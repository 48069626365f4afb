/* The products of symmetric_update.h on vectors of any width. A source with vectors of its own
 * defines TENDONFMU_OWN_LANES and, in its unnamed namespace, before it includes this: lane_vector, lanes, load, store,
 * spread (one number into all lanes), multiply_add(a, b, c) = a·b + c; and the size of a tile, tile_vectors · lanes
 * rows by tile_columns columns, that fits into its registers. Else portable_lanes.h has them.
 *
 * Everything here is in the unnamed namespace and uses no inline function of another header: compiled for different
 * processors, no two copies of it may be taken for the same function. */
#pragma once

#include "symmetric_update.h"

#if !defined(TENDONFMU_OWN_LANES)
#include "portable_lanes.h"
#endif

#if defined(_MSC_VER)
#define ALWAYS_INLINE __forceinline
#else
#define ALWAYS_INLINE inline __attribute__((always_inline))
#endif

namespace tendonfmu::estimation {
namespace {

constexpr std::size_t tile_rows = tile_vectors * lanes; /* rows of a tile */
constexpr std::size_t packed_steps = 128;               /* of the inner sum that are packed at once */
constexpr std::size_t packed_columns = 48;              /* columns of the result that are packed at once */
static_assert(packed_columns % tile_rows == 0 && packed_columns % tile_columns == 0, "tiles fill what is packed");

constexpr std::ptrdiff_t everything = -static_cast<std::ptrdiff_t>(tile_columns); /* diagonal of a tile far below it */

std::size_t least(std::size_t a, std::size_t b) {
  return a < b ? a : b;
}

/* sum = Σ over the steps of left [steps × tile_rows] times right [steps × tile_columns], both packed */
ALWAYS_INLINE void multiply_tile(const double* left, const double* right, std::size_t steps,
                                 lane_vector sum[tile_columns][tile_vectors]) {
#pragma GCC unroll 8
  for (std::size_t c = 0; c < tile_columns; ++c) {
#pragma GCC unroll 8
    for (std::size_t v = 0; v < tile_vectors; ++v) {
      sum[c][v] = spread(0.0);
    }
  }
  for (std::size_t s = 0; s < steps; ++s, left += tile_rows, right += tile_columns) {
    lane_vector tall[tile_vectors];
#pragma GCC unroll 8
    for (std::size_t v = 0; v < tile_vectors; ++v) {
      tall[v] = load(left + v * lanes);
    }
#pragma GCC unroll 8
    for (std::size_t c = 0; c < tile_columns; ++c) {
      const lane_vector one = spread(right[c]);
#pragma GCC unroll 8
      for (std::size_t v = 0; v < tile_vectors; ++v) {
        sum[c][v] = multiply_add(tall[v], one, sum[c][v]);
      }
    }
  }
}

/* target += factor · tile, where it lies wholly within the target, column after column */
void add_tile(const double* left, const double* right, std::size_t steps, double factor, double* target,
              std::size_t stride) {
  lane_vector sum[tile_columns][tile_vectors];
  multiply_tile(left, right, steps, sum);
  const lane_vector scale = spread(factor);
#pragma GCC unroll 8
  for (std::size_t c = 0; c < tile_columns; ++c) {
#pragma GCC unroll 8
    for (std::size_t v = 0; v < tile_vectors; ++v) {
      double* at = target + c * stride + v * lanes;
      store(at, multiply_add(sum[c][v], scale, load(at)));
    }
  }
}

/* The same for a tile at the edge: its first `tall` rows and `wide` columns, and of column c only from row diagonal + c
 * on. The same bits as of add_tile(), so that an element does not depend on where the tiles begin. */
void add_tile_edge(const double* left, const double* right, std::size_t steps, double factor, double* target,
                   std::size_t stride, std::size_t tall, std::size_t wide, std::ptrdiff_t diagonal) {
  lane_vector sum[tile_columns][tile_vectors];
  multiply_tile(left, right, steps, sum);
  const lane_vector scale = spread(factor);
  for (std::size_t c = 0; c < wide; ++c) {
    const std::ptrdiff_t row = diagonal + static_cast<std::ptrdiff_t>(c);
    const std::size_t begin = row > 0 ? static_cast<std::size_t>(row) : 0;
    double part[tile_rows] = {};
    for (std::size_t r = begin; r < tall; ++r) {
      part[r] = target[c * stride + r];
    }
    for (std::size_t v = 0; v < tile_vectors; ++v) {
      store(part + v * lanes, multiply_add(sum[c][v], scale, load(part + v * lanes)));
    }
    for (std::size_t r = begin; r < tall; ++r) {
      target[c * stride + r] = part[r];
    }
  }
}

/* columns [first, first + width) of `steps` rows, side by side, full_width numbers a step: where width is less, then
 * zeros */
template <std::size_t full_width>
void pack_rows(const double* rows, std::size_t stride, std::size_t steps, std::size_t first, std::size_t width,
               double* packed) {
  static_assert(full_width % lanes == 0, "whole vectors");
  for (std::size_t s = 0; s < steps; ++s, packed += full_width) {
    const double* row = rows + s * stride + first;
    if (width == full_width) {
#pragma GCC unroll 8
      for (std::size_t i = 0; i < full_width; i += lanes) {
        store(packed + i, load(row + i));
      }
      continue;
    }
    for (std::size_t i = 0; i < full_width; ++i) {
      packed[i] = i < width ? row[i] : 0.0;
    }
  }
}

/* columns [first, first + packed_columns) of the triangle, with the rows of one packing */
void add_to_columns(double* lower, std::size_t p, std::size_t first, const double* rows, std::size_t steps,
                    std::size_t stride, double factor) {
  alignas(64) double right[packed_columns * packed_steps], left[tile_rows * packed_steps];
  const std::size_t end = least(first + packed_columns, p);
  for (std::size_t j = first; j < end; j += tile_columns) {
    pack_rows<tile_columns>(rows, stride, steps, j, least(tile_columns, p - j), right + (j - first) * steps);
  }
  for (std::size_t i = first; i < p; i += tile_rows) {
    const std::size_t tall = least(tile_rows, p - i);
    pack_rows<tile_rows>(rows, stride, steps, i, tall, left);
    for (std::size_t j = first; j < least(end, i + tall); j += tile_columns) {
      const double* columns = right + (j - first) * steps;
      double* target = lower + j * p + i;
      if (tall == tile_rows && i >= j + tile_columns - 1 && j + tile_columns <= p) {
        add_tile(left, columns, steps, factor, target, p);
        continue;
      }
      add_tile_edge(left, columns, steps, factor, target, p, tall, least(tile_columns, p - j),
                    static_cast<std::ptrdiff_t>(j) - static_cast<std::ptrdiff_t>(i));
    }
  }
}

void add_products(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride, double factor) {
  for (std::size_t done = 0; done < k; done += packed_steps) {
    for (std::size_t first = 0; first < p; first += packed_columns) {
      add_to_columns(lower, p, first, rows + done * stride, least(packed_steps, k - done), stride, factor);
    }
  }
}

/* `full` of the rows from `first` on, one number of each a step, from the used columns (nullptr: all); beyond `end`
 * zeros */
void pack_columns(const double* rows, std::size_t stride, std::size_t first, std::size_t end, std::size_t full,
                  const std::size_t* used, std::size_t count, double* packed) {
  for (std::size_t s = 0; s < count; ++s, packed += full) {
    for (std::size_t r = 0; r < full; ++r) {
      packed[r] = first + r < end ? rows[(first + r) * stride + (used ? used[s] : s)] : 0.0;
    }
  }
}

/* target += factor · left · right, packed both: `tall` rows of at most packed_columns columns */
void add_rectangle(double* target, std::size_t stride, std::size_t wide, const double* left, std::size_t tall,
                   const double* right, std::size_t steps, double factor) {
  for (std::size_t c = 0; c < wide; c += tile_columns) {
    const double* columns = right + c * steps;
    if (tall == tile_rows && c + tile_columns <= wide) {
      add_tile(left, columns, steps, factor, target + c * stride, stride);
    } else {
      add_tile_edge(left, columns, steps, factor, target + c * stride, stride, tall, least(tile_columns, wide - c),
                    everything);
    }
  }
}

/* columns of the rows that are not zero, from `next` on, at most packed_steps of them; `next` goes on */
std::size_t used_columns(const double* rows, std::size_t k, std::size_t stride, std::size_t p, std::size_t* next,
                         std::size_t used[packed_steps]) {
  std::size_t count = 0;
  while (count < packed_steps && *next < p) {
    const std::size_t first = *next, width = least(lanes, p - first);
    int nonzero[lanes] = {};
    for (std::size_t r = 0; r < k; ++r) {
      for (std::size_t i = 0; i < width; ++i) {
        nonzero[i] |= rows[r * stride + first + i] != 0.0;
      }
    }
    for (std::size_t i = 0; i < width && count < packed_steps; ++i, ++*next) {
      if (nonzero[i]) {
        used[count++] = first + i;
      }
    }
  }
  return count;
}

/* the symmetric matrix at rows [first, first + tall) and the used columns, for multiply_tile; columns are increasing */
void pack_symmetric(const double* lower, std::size_t p, std::size_t first, std::size_t tall, const std::size_t* used,
                    std::size_t count, double* packed) {
  for (std::size_t s = 0; s < count; ++s, packed += tile_rows) {
    const std::size_t c = used[s];
    const double* column = lower + c * p + first;
    if (c <= first && tall == tile_rows) {
#pragma GCC unroll 8
      for (std::size_t v = 0; v < tile_vectors; ++v) {
        store(packed + v * lanes, load(column + v * lanes));
      }
      continue;
    }
    if (c >= first + tile_rows && tall == tile_rows) { /* beyond the diagonal: what stands in row c */
      const double* row = lower + first * p + c;
#pragma GCC unroll 32
      for (std::size_t i = 0; i < tile_rows; ++i) {
        packed[i] = row[i * p];
      }
      continue;
    }
    for (std::size_t i = 0; i < tall; ++i) {
      packed[i] = first + i >= c ? column[i] : lower[(first + i) * p + c];
    }
    for (std::size_t i = tall; i < tile_rows; ++i) {
      packed[i] = 0.0;
    }
  }
}

/* adds the part of the product that the used columns make, for at most packed_columns rows */
void add_used_columns(double* product, std::size_t product_stride, const double* lower, std::size_t p,
                      const double* rows, std::size_t k, std::size_t stride, const std::size_t* used,
                      std::size_t count) {
  alignas(64) double right[packed_columns * packed_steps], left[tile_rows * packed_steps];
  for (std::size_t r = 0; r < k; r += tile_columns) {
    pack_columns(rows, stride, r, k, tile_columns, used, count, right + r * count);
  }
  for (std::size_t i = 0; i < p; i += tile_rows) {
    const std::size_t tall = least(tile_rows, p - i);
    pack_symmetric(lower, p, i, tall, used, count, left);
    add_rectangle(product + i, product_stride, k, left, tall, right, count, 1.0);
  }
}

void clear(double* target, std::size_t stride, std::size_t rows, std::size_t width) {
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t i = 0; i < width; ++i) {
      target[r * stride + i] = 0.0;
    }
  }
}

void multiply_rows(double* product, std::size_t product_stride, const double* lower, std::size_t p, const double* rows,
                   std::size_t k, std::size_t stride) {
  for (std::size_t done = 0; done < k; done += packed_columns) {
    const std::size_t some = least(packed_columns, k - done);
    double* target = product + done * product_stride;
    const double* source = rows + done * stride;
    clear(target, product_stride, some, p);
    std::size_t next = 0, used[packed_steps];
    while (const std::size_t count = used_columns(source, some, stride, p, &next, used)) {
      add_used_columns(target, product_stride, lower, p, source, some, stride, used, count);
    }
  }
}

/* at most packed_columns rows of the target, with at most packed_steps of the rows */
void add_mixed(double* target, std::size_t target_stride, std::size_t a, const double* weights,
               std::size_t weight_stride, const double* rows, std::size_t steps, std::size_t stride, std::size_t p,
               double factor) {
  alignas(64) double right[packed_columns * packed_steps], left[tile_rows * packed_steps];
  for (std::size_t r = 0; r < a; r += tile_columns) {
    pack_columns(weights, weight_stride, r, a, tile_columns, nullptr, steps, right + r * steps);
  }
  for (std::size_t i = 0; i < p; i += tile_rows) {
    const std::size_t tall = least(tile_rows, p - i);
    pack_rows<tile_rows>(rows, stride, steps, i, tall, left);
    add_rectangle(target + i, target_stride, a, left, tall, right, steps, factor);
  }
}

void mix_rows(double* target, std::size_t target_stride, std::size_t a, const double* weights,
              std::size_t weight_stride, const double* rows, std::size_t k, std::size_t stride, std::size_t p,
              double factor) {
  for (std::size_t first = 0; first < a; first += packed_columns) {
    for (std::size_t done = 0; done < k; done += packed_steps) {
      add_mixed(target + first * target_stride, target_stride, least(packed_columns, a - first),
                weights + first * weight_stride + done, weight_stride, rows + done * stride,
                least(packed_steps, k - done), stride, p, factor);
    }
  }
}

void multiply_by_rows(double* product, std::size_t product_stride, const double* left, std::size_t a,
                      std::size_t left_stride, const double* right, std::size_t b, std::size_t right_stride,
                      std::size_t p) {
  alignas(64) double columns[packed_columns * packed_steps], packed[tile_rows * packed_steps];
  clear(product, product_stride, a, b);
  for (std::size_t first = 0; first < a; first += packed_columns) {
    const double* some = left + first * left_stride;
    const std::size_t wide = least(packed_columns, a - first);
    std::size_t next = 0, used[packed_steps];
    while (const std::size_t count = used_columns(some, wide, left_stride, p, &next, used)) {
      for (std::size_t r = 0; r < wide; r += tile_columns) {
        pack_columns(some, left_stride, r, wide, tile_columns, used, count, columns + r * count);
      }
      for (std::size_t i = 0; i < b; i += tile_rows) {
        pack_columns(right, right_stride, i, b, tile_rows, used, count, packed);
        add_rectangle(product + first * product_stride + i, product_stride, wide, packed, least(tile_rows, b - i),
                      columns, count, 1.0);
      }
    }
  }
}

}  // namespace
}  // namespace tendonfmu::estimation

#undef ALWAYS_INLINE
