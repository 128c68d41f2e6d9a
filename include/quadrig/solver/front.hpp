// Dense arithmetic of one front of a sparse Cholesky factorization.
#pragma once

#include <cmath>
#include <cstring>

#include "quadrig/solver/instructions.hpp"

namespace quadrig::detail {

/// Sums over more columns than this are cut into blocks of `front_deep`, which lie on few pages: in single precision,
/// which is for large systems. In double it would change the last bits of every map, small ones too.
template <class Real>
inline constexpr Index front_large = sizeof(Real) == 4 ? 128 : std::numeric_limits<Index>::max();
inline constexpr Index front_deep = 64;

#if defined(__GNUC__)
/// Tiles of target −= left · rightᴴ in vectors of `bytes` bytes. Each entry is summed over the depth in its own order
/// and by the same operations whatever the width, so that every processor gives the same bits.
template <class K, int bytes>
struct FrontTile {
  using Real = real_of<K>;
  static constexpr bool is_complex = !std::is_same_v<K, Real>;
  static constexpr Index lanes = bytes / static_cast<int>(sizeof(K));
  static constexpr int numbers = bytes / static_cast<int>(sizeof(Real));
  typedef Real Vector __attribute__((vector_size(bytes)));

  // Rows [0, V·lanes) and C columns.
  template <int V, int C>
  QUADRIG_INTO_CALLER static void subtract(const K* left, std::ptrdiff_t left_stride, const K* right, Index depth,
                                           K* target, std::ptrdiff_t stride) {
    Vector sum[V][C] = {}, cross[V][C] = {};
    for (Index k = 0; k < depth; ++k, left += left_stride, right += left_stride) {
      Vector a[V];
      for (int v = 0; v < V; ++v) std::memcpy(&a[v], left + v * lanes, sizeof(Vector));
      for (int c = 0; c < C; ++c) {
        if constexpr (is_complex) {
          const Real re = right[c].real(), im = right[c].imag();
          for (int v = 0; v < V; ++v) sum[v][c] += a[v] * re;
          for (int v = 0; v < V; ++v) cross[v][c] += a[v] * im;
        } else {
          for (int v = 0; v < V; ++v) sum[v][c] += a[v] * right[c];
        }
      }
    }
    for (int c = 0; c < C; ++c)
      for (int v = 0; v < V; ++v) {
        K* const place = target + c * stride + v * lanes;
        Vector t;
        std::memcpy(&t, place, sizeof(Vector));
        if constexpr (is_complex) {
          Vector turned{}, sign{};
          if constexpr (numbers == 2)
            turned = __builtin_shufflevector(cross[v][c], cross[v][c], 1, 0);
          else if constexpr (numbers == 4)
            turned = __builtin_shufflevector(cross[v][c], cross[v][c], 1, 0, 3, 2);
          else
            turned = __builtin_shufflevector(cross[v][c], cross[v][c], 1, 0, 3, 2, 5, 4, 7, 6);
          for (int i = 0; i < numbers; ++i) sign[i] = i % 2 == 0 ? Real(1) : Real(-1);
          t -= sum[v][c] + turned * sign;
        } else {
          t -= sum[v][c];
        }
        std::memcpy(static_cast<void*>(place), &t, sizeof(Vector));
      }
  }

  QUADRIG_INTO_CALLER static void subtract_one(const K* left, std::ptrdiff_t left_stride, const K* right, Index depth,
                                               K* target) {
    if constexpr (is_complex) {
      Real sum_re = 0, sum_im = 0, cross_re = 0, cross_im = 0;
      for (Index k = 0; k < depth; ++k, left += left_stride, right += left_stride) {
        const Real re = right->real(), im = right->imag();
        sum_re += left->real() * re;
        sum_im += left->imag() * re;
        cross_re += left->real() * im;
        cross_im += left->imag() * im;
      }
      *target = K(target->real() - (sum_re + cross_im), target->imag() - (sum_im - cross_re));
    } else {
      Real sum = 0;
      for (Index k = 0; k < depth; ++k, left += left_stride, right += left_stride) sum += *left * *right;
      *target -= sum;
    }
  }

  template <int C>
  QUADRIG_INTO_CALLER static void columns(const K* left, std::ptrdiff_t left_stride, Index rows, const K* right,
                                          Index depth, K* target, std::ptrdiff_t stride) {
    Index i = 0;
    for (; i + 2 * lanes <= rows; i += 2 * lanes)
      subtract<2, C>(left + i, left_stride, right, depth, target + i, stride);
    for (; i + lanes <= rows; i += lanes) subtract<1, C>(left + i, left_stride, right, depth, target + i, stride);
    if constexpr (lanes >= 4)
      for (; i + lanes / 2 <= rows; i += lanes / 2)
        FrontTile<K, bytes / 2>::template subtract<1, C>(left + i, left_stride, right, depth, target + i, stride);
    for (; i < rows; ++i)
      for (int c = 0; c < C; ++c) subtract_one(left + i, left_stride, right + c, depth, target + c * stride + i);
  }

  /// Columns [0, count) of target from each one's diagonal on; of the first rows above it, too. In blocks of
  /// rows, and of a large depth, that stay in the caches.
  QUADRIG_INTO_CALLER static void trapezoid(const K* left, std::ptrdiff_t left_stride, Index depth, K* target,
                                            std::ptrdiff_t stride, Index rows, Index count) {
    constexpr Index wide = !is_complex ? 4 : sizeof(Real) == 4 ? 3 : 2, tall = 256;
    const Index deep = depth > front_large<Real> ? front_deep : depth;
    for (Index k = 0; k < depth; k += deep, left += deep * left_stride) {
      const Index part = std::min(deep, depth - k);
      for (Index top = 0; top < rows; top += tall) {
        const Index bottom = std::min(rows, top + tall), last = std::min(count, bottom);
        Index j = 0;
        const auto some = [&]<int C>(std::integral_constant<int, C>) QUADRIG_INTO_CALLER_LAMBDA {
          for (; j + C <= last; j += C) {
            const Index i = std::max(j, top);
            columns<C>(left + i, left_stride, bottom - i, left + j, part, target + j * stride + i, stride);
          }
        };
        some(std::integral_constant<int, wide>());
        if constexpr (wide == 3) some(std::integral_constant<int, 2>());
        some(std::integral_constant<int, 1>());
      }
    }
  }
};
#endif

/// A panel of `width` columns with `height` rows, by columns, of which the lower trapezoid counts, and the square of
/// height − width that is left for the parent, of which the lower triangle counts.
/// Sums are cut into blocks that do not depend on the threads.
template <class K>
struct Front {
  using Real = real_of<K>;
  static constexpr Index panel_block = 8, thread_block = 16;
  static constexpr double worth_threads = 4e6;  // multiplications

  static std::ptrdiff_t offset(Index column, Index stride) { return static_cast<std::ptrdiff_t>(column) * stride; }

  /// LLᴴ of the panel: its upper part factored, the rows below solved for; numbers below `negligible` become 0.
  /// `accept(column, pivot)` says whether to go on. Returns the column that was not accepted, or no_index.
  template <class Accept>
  static Index factorize(K* panel, Index width, Index height, Real negligible, Accept&& accept,
                         const Context* context) {
    const Index outer_block = width > front_large<Real> ? front_deep : width;
    for (Index first = 0; first < width; first += outer_block) {
      const Index last = std::min(width, first + outer_block);
      for (Index begin = first; begin < last; begin += panel_block) {
        const Index end = std::min(last, begin + panel_block);
        for (Index j = begin; j < end; ++j) {
          K* const column = panel + offset(j, height);
          if (j > begin)
            trapezoid(panel + offset(begin, height) + j, height, j - begin, column + j, height, height - j, 1);
          const Real pivot = std::real(column[j]);
          if (!accept(j, pivot)) return j;
          const Real root = std::sqrt(pivot), inverse = 1 / root;
          column[j] = K(root);
          for (Index i = j + 1; i < height; ++i) column[i] *= inverse;
          if (negligible > 0)
            clear(reinterpret_cast<Real*>(column + j + 1), reinterpret_cast<Real*>(column + height), negligible);
        }
        if (end < last)
          subtract_product(panel + offset(begin, height) + end, end - begin, height, panel + offset(end, height) + end,
                           height, height - end, last - end, context);
      }
      if (last < width)
        subtract_product(panel + offset(first, height) + last, last - first, height,
                         panel + offset(last, height) + last, height, height - last, width - last, context);
    }
    return no_index;
  }

  /// The lower trapezoid of target (rows × columns) −= left · (upper rows of left)ᴴ, left being rows × depth.
  static void subtract_product(const K* left, Index depth, Index left_stride, K* target, Index stride, Index rows,
                               Index columns, const Context* context) {
    if (!context || static_cast<double>(rows) * columns * depth < worth_threads)
      return trapezoid(left, left_stride, depth, target, stride, rows, columns);
    const Index blocks = (columns + thread_block - 1) / thread_block;
    context->parallel_for(static_cast<std::size_t>(blocks), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t k = first; k < last; ++k) {
        // Long blocks and short ones in turn, for the threads' sake.
        const auto half = static_cast<Index>(k / 2);
        const Index c = thread_block * (k % 2 == 0 ? half : blocks - 1 - half);
        trapezoid(left + c, left_stride, depth, target + offset(c, stride) + c, stride, rows - c,
                  std::min(thread_block, columns - c));
      }
    });
  }

 private:
  static void clear(Real* begin, Real* end, Real negligible) {
    for (; begin != end; ++begin) *begin = std::abs(*begin) < negligible ? Real(0) : *begin;
  }

  static void trapezoid(const K* left, Index left_stride, Index depth, K* target, Index stride, Index rows,
                        Index count) {
#if defined(__GNUC__)
    run_best([=]<int bytes>(VectorBytes<bytes>) QUADRIG_INTO_CALLER_LAMBDA {
      FrontTile<K, bytes>::trapezoid(left, left_stride, depth, target, stride, rows, count);
    });
#else
    for (Index j = 0; j < count; ++j)
      for (Index k = 0; k < depth; ++k) {
        const K factor = conjugate(left[offset(k, left_stride) + j]);
        for (Index i = j; i < rows; ++i) target[offset(j, stride) + i] -= left[offset(k, left_stride) + i] * factor;
      }
#endif
  }
};

}  // namespace quadrig::detail
