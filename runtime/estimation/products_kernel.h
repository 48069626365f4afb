/* The products of products.h for the processor that a source is compiled for. All of it stays in that source: it is in
 * an unnamed namespace, and takes nothing from headers but Eigen's templates. */
#pragma once

#include <Eigen/Core>

#include "products.h"

namespace tendonfmu::estimation {
namespace {

using Eigen::Index;
using Eigen::Lower;
using by_columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor>;
using by_rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using columns_view = Eigen::Map<by_columns>;
using rows_view = Eigen::Map<by_rows, 0, Eigen::OuterStride<>>;
using const_columns_view = Eigen::Map<const by_columns>;
using const_rows_view = Eigen::Map<const by_rows, 0, Eigen::OuterStride<>>;

/* Of what is multiplied at once: what Eigen copies then fits on the stack, and Eigen does not divide the sums. */
constexpr Index wide = 84, deep = 80, tall = 48, strip = 8;

Index least(Index a, Index b) {
  return a < b ? a : b;
}

template <typename View, typename Number>
View rows_at(Number* first, std::size_t k, std::size_t p, std::size_t stride) {
  return View(first, static_cast<Index>(k), static_cast<Index>(p), Eigen::OuterStride<>(static_cast<Index>(stride)));
}

/* target += factor · left · right, part by part */
template <typename Target, typename Left, typename Right>
void add_product(Target target, double factor, const Left& left, const Right& right) {
  for (Index done = 0; done < left.cols(); done += deep) {
    const Index depth = least(deep, left.cols() - done);
    for (Index i = 0; i < left.rows(); i += wide) {
      const auto some = left.block(i, done, least(wide, left.rows() - i), depth);
      for (Index j = 0; j < right.cols(); j += wide) {
        const auto others = right.block(done, j, depth, least(wide, right.cols() - j));
        target.block(i, j, some.rows(), others.cols()).noalias() += factor * some * others;
      }
    }
  }
}

void add_outer_products(double* lower, std::size_t p, const double* rows, std::size_t k, std::size_t stride,
                        double factor) {
  const auto order = static_cast<Index>(p);
  columns_view sum(lower, order, order);
  const auto all = rows_at<const_rows_view>(rows, k, p, stride);
  for (Index c = 0; c < order; c += wide) {
    const Index width = least(wide, order - c), below = order - c - width;
    const auto columns = all.middleCols(c, width);
    for (Index done = 0; done < all.rows(); done += deep) {
      const auto some = columns.middleRows(done, least(deep, all.rows() - done));
      sum.block(c, c, width, width).selfadjointView<Lower>().rankUpdate(some.transpose(), factor);
    }
    add_product(sum.block(c + width, c, below, width), factor, all.rightCols(below).transpose(), columns);
  }
}

/* the next columns that are not zero in all of these rows, at most `deep` */
Index find_used(const const_rows_view& rows, Index* next, Index used[deep]) {
  Index count = 0;
  for (; *next < rows.cols() && count < deep; ++*next) {
    used[count] = *next;
    count += (rows.col(*next).array() != 0.0).any();
  }
  return count;
}

void multiply_symmetric(double* product, std::size_t product_stride, const double* lower, std::size_t p,
                        const double* rows, std::size_t k, std::size_t stride) {
  const auto order = static_cast<Index>(p), count = static_cast<Index>(k);
  const const_columns_view s(lower, order, order);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, tall, deep> left;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, deep, wide> right;
  auto target = rows_at<rows_view>(product, k, p, product_stride);
  target.setZero();
  for (Index first = 0; first < count; first += tall) {
    const std::size_t height = static_cast<std::size_t>(least(tall, count - first));
    const auto some = rows_at<const_rows_view>(rows + static_cast<std::size_t>(first) * stride, height, p, stride);
    Index next = 0, used[deep];
    while (const Index depth = find_used(some, &next, used)) {
      left.resize(some.rows(), depth);
      for (Index u = 0; u < depth; ++u) {
        left.col(u) = some.col(used[u]);
      }
      for (Index i = 0; i < order; i += wide) {
        const Index width = least(wide, order - i);
        right.resize(depth, width);
        /* what the triangle has above the diagonal stands in rows: a few columns at a time, each read downwards */
        for (Index c = 0; c < width; c += strip) {
          for (Index u = 0; u < depth; ++u) {
            for (Index k = c; k < least(least(c + strip, width), used[u] - i); ++k) {
              right(u, k) = s(used[u], i + k);
            }
          }
        }
        for (Index u = 0; u < depth; ++u) {
          const Index above = used[u] > i ? least(used[u] - i, width) : 0;
          right.row(u).tail(width - above) = s.col(used[u]).segment(i + above, width - above).transpose();
        }
        target.block(first, i, some.rows(), width).noalias() += left * right;
      }
    }
  }
}

void multiply_transposed(double* product, std::size_t product_stride, const double* left, std::size_t a,
                         std::size_t left_stride, const double* right, std::size_t b, std::size_t right_stride,
                         std::size_t p) {
  auto target = rows_at<rows_view>(product, a, b, product_stride);
  target.setZero();
  add_product(target.leftCols(target.cols()), 1.0, rows_at<const_rows_view>(left, a, p, left_stride),
              rows_at<const_rows_view>(right, b, p, right_stride).transpose());
}

void solve_lower(const double* factor, std::size_t factor_stride, double* rows, std::size_t k, std::size_t stride,
                 std::size_t p) {
  const auto l = rows_at<const_rows_view>(factor, k, k, factor_stride);
  auto all = rows_at<rows_view>(rows, k, p, stride);
  for (Index first = 0; first < l.rows(); first += deep) {
    const Index height = least(deep, l.rows() - first);
    add_product(all.middleRows(first, height), -1.0, l.block(first, 0, height, first), all.topRows(first));
    for (Index i = 0; i < all.cols(); i += wide) {
      auto some = all.block(first, i, height, least(wide, all.cols() - i));
      l.block(first, first, height, height).triangularView<Lower>().solveInPlace(some);
    }
  }
}

}  // namespace
}  // namespace tendonfmu::estimation
