// A Hermitian matrix by rows in blocks that a cache holds: the passes of multigrid over it, as few as there can be.
#pragma once

#include "quadrig/solver/aggregation.hpp"

namespace quadrig::detail {

/// Rows in blocks of neighbours. Entries within a block lie apart from the few that leave it, so that a block is
/// smoothed and its residual taken, or its direction renewed and multiplied, while it is in the cache; what leaves
/// comes after, when every block is done. Each sum is made by one block, so the bits do not depend on the threads.
template <class K>
class BlockedRows {
 public:
  using Real = real_of<K>;
  static constexpr std::size_t block = 4096;

  BlockedRows() = default;
  /// A, times a factor, with its rows and columns in another order: row i is row order[i] of A. The last `kept`
  /// unknowns are not smoothed: coarser levels alone move them. \pre a permutation
  template <class Wide>
  BlockedRows(const SparseRows<Wide>& A, std::span<const Index> order, real_of<Wide> factor = 1, std::size_t kept = 0)
      : smoothed_(order.size() - kept), diagonal_(order.size()), inverse_(order.size()), rows_(order.size()) {
    const std::size_t n = order.size();
    std::vector<Index> position(n);
    for (std::size_t i = 0; i < n; ++i) position[at(order[i])] = static_cast<Index>(i);
    columns_.reserve(A.columns.size() - n);
    outer_blocks_.reserve(n / block + 2);
    values_.reserve(A.values.size() - n);
    for (std::size_t begin = 0; begin < n; begin += block) {
      const auto first = static_cast<Index>(begin), last = static_cast<Index>(std::min(n, begin + block));
      for (Index i = first; i < last; ++i) {
        const std::size_t from = A.starts[at(order[at(i)])], to = A.starts[at(order[at(i)]) + 1];
        const auto take = [&](auto&& wanted, Index base, auto& columns, std::vector<K>& values) {
          const std::size_t before = values.size();
          for (std::size_t e = from; e < to; ++e)
            if (const Index j = position[at(A.columns[e])]; wanted(j)) {
              columns.push_back(static_cast<typename std::remove_reference_t<decltype(columns)>::value_type>(j - base));
              values.push_back(static_cast<K>(factor * A.values[e]));
            }
          return values.size() - before;
        };
        for (std::size_t e = from; e < to; ++e)
          if (A.columns[e] == order[at(i)]) diagonal_[at(i)] = static_cast<Real>(factor * std::real(A.values[e]));
        inverse_[at(i)] = 1 / diagonal_[at(i)];
        Row& row = rows_[at(i)];
        row.left = static_cast<Local>(take([&](Index j) { return j >= first && j < i; }, first, columns_, values_));
        row.right = static_cast<Local>(take([&](Index j) { return j > i && j < last; }, first, columns_, values_));
        if (at(i) >= smoothed_) inverse_[at(i)] = 0;
        const std::size_t outer = outer_columns_.size();
        if (take([&](Index j) { return j < first || j >= last; }, 0, outer_columns_, outer_values_) == 0) continue;
        outer_rows_.push_back(i);
        outer_starts_.push_back(outer_columns_.size());
        // The sweep converges where the diagonal, with twice what is added to it, outweighs what the sweep leaves out.
        Real left_out = 0;
        for (std::size_t o = outer; o < outer_columns_.size(); ++o)
          if (at(outer_columns_[o]) < smoothed_) left_out += std::abs(outer_values_[o]);
        const Real more = std::max(Real(0), (left_out - Real(0.9) * diagonal_[at(i)]) / 2);
        outer_more_.push_back(at(i) < smoothed_ ? more : 0);
        if (at(i) < smoothed_) inverse_[at(i)] = 1 / (diagonal_[at(i)] + more);
      }
      bases_.push_back(columns_.size());
      outer_blocks_.push_back(outer_rows_.size());
    }
    halo_rows_ = outer_columns_;
    std::sort(halo_rows_.begin(), halo_rows_.end());
    halo_rows_.erase(std::unique(halo_rows_.begin(), halo_rows_.end()), halo_rows_.end());
    std::vector<Index>& place = position;  // no longer needed
    for (std::size_t h = 0; h < halo_rows_.size(); ++h) place[at(halo_rows_[h])] = static_cast<Index>(h);
    for (Index& column : outer_columns_) column = place[at(column)];
    for (std::size_t k = 0, h = 0; k * block < n; ++k) {
      while (h < halo_rows_.size() && at(halo_rows_[h]) < (k + 1) * block) ++h;
      halo_blocks_.push_back(h);
    }
    halo_.resize(halo_rows_.size());
  }

  [[nodiscard]] std::size_t size() const { return diagonal_.size(); }
  [[nodiscard]] std::size_t entries() const { return values_.size() + outer_values_.size() + diagonal_.size(); }
  [[nodiscard]] const std::vector<Real>& diagonal() const { return diagonal_; }

  /// The matrix as it was; columns in another order.
  [[nodiscard]] SparseRows<K> rows() const {
    SparseRows<K> all;
    all.columns_count = static_cast<Index>(size());
    std::size_t outer = 0, e = 0;
    for (std::size_t k = 0; k * block < size(); ++k)
      for (std::size_t i = k * block; i < std::min(size(), (k + 1) * block); ++i) {
        all.columns.push_back(static_cast<Index>(i));
        all.values.push_back(K(diagonal_[i]));
        for (const std::size_t end = e + rows_[i].count(); e < end; ++e) {
          all.columns.push_back(static_cast<Index>(k * block + columns_[e]));
          all.values.push_back(values_[e]);
        }
        if (outer < outer_rows_.size() && at(outer_rows_[outer]) == i) {
          for (std::size_t o = outer_starts_[outer]; o < outer_starts_[outer + 1]; ++o) {
            all.columns.push_back(halo_rows_[at(outer_columns_[o])]);
            all.values.push_back(outer_values_[o]);
          }
          ++outer;
        }
        all.starts.push_back(all.columns.size());
      }
    return all;
  }

  /// p = z + β p and q = A p; returns p · q. p may be of shorter numbers.
  template <class Rough>
  [[nodiscard]] double renew_and_multiply(std::span<const Rough> z, real_of<Rough> beta, std::span<Rough> p,
                                          std::span<K> q, const Context& context) {
    const double inner = sum_of_blocks(context, [&](std::size_t k, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) p[i] = z[i] + beta * p[i];
      show(k, p.data());
      double sum = 0;
      std::size_t e = bases_[k];
      for (std::size_t i = begin; i < end; ++i) {
        const K own = static_cast<K>(p[i]);
        q[i] = diagonal_[i] * own - minus(e, rows_[i].count(), p.data() + begin);
        e += rows_[i].count();
        sum += product(own, q[i]);
      }
      return sum;
    });
    return inner + sum_of_blocks(context, [&](std::size_t k, std::size_t, std::size_t) {
             double sum = 0;
             for (std::size_t o = outer_blocks_[k]; o < outer_blocks_[k + 1]; ++o) {
               const std::size_t i = at(outer_rows_[o]);
               const K more = -minus_outer(o);
               q[i] += more;
               sum += product(static_cast<K>(p[i]), more);
             }
             return sum;
           });
  }
  /// r = b − A x.
  void residual(std::span<const K> b, std::span<const K> x, std::span<K> r, const Context& context) {
    for_each_block(context, [&](std::size_t k, std::size_t begin, std::size_t end) {
      std::size_t e = bases_[k];
      for (std::size_t i = begin; i < end; e += rows_[i++].count())
        r[i] = b[i] - diagonal_[i] * x[i] + minus(e, rows_[i].count(), x.data() + begin);
      show(k, x.data());
    });
    subtract_outer(r, context);
  }
  /// x = one sweep of Gauss–Seidel within blocks, upwards, on b from zero; r = b − A x.
  void smooth_upwards(std::span<const K> b, std::span<K> x, std::span<K> r, const Context& context) {
    for_each_block(context, [&](std::size_t k, std::size_t begin, std::size_t end) {
      std::size_t e = bases_[k];
      for (std::size_t i = begin; i < end; e += rows_[i++].count())
        x[i] = inverse_[i] * (b[i] + minus(e, rows_[i].left, x.data() + begin));
      e = bases_[k];
      const std::size_t met = std::max(begin, std::min(end, smoothed_));
      for (std::size_t i = begin; i < met; e += rows_[i++].count())  // the rest of the row is met
        r[i] = minus(e + rows_[i].left, rows_[i].right, x.data() + begin);
      for (std::size_t i = met; i < end; e += rows_[i++].count())
        r[i] = b[i] + minus(e, rows_[i].count(), x.data() + begin);
      show(k, x.data());
    });
    for_each_block(context, [&](std::size_t k, std::size_t, std::size_t) {
      for (std::size_t o = outer_blocks_[k]; o < outer_blocks_[k + 1]; ++o)
        r[at(outer_rows_[o])] += minus_outer(o) + outer_more_[o] * x[at(outer_rows_[o])];
    });
  }
  /// x += P y, then the sweep downwards on b; returns b · x.
  double correct_and_smooth_downwards(const SparseRows<K>& P, std::span<const K> y, std::span<const K> b,
                                      std::span<K> x, const Context& context) {
    for_each_block(context, [&](std::size_t k, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        K correction{};
        for (std::size_t e = P.starts[i]; e < P.starts[i + 1]; ++e)
          subtract_product(correction, P.values[e], y[at(P.columns[e])]);
        x[i] -= correction;
      }
      show(k, x.data());
    });
    return sum_of_blocks(context, [&](std::size_t k, std::size_t begin, std::size_t end) {
      std::size_t e = bases_[k + 1], o = outer_blocks_[k + 1];
      double sum = 0;
      for (std::size_t i = end; i-- > begin;) {
        e -= rows_[i].count();
        K value = b[i] + minus(e, rows_[i].count(), x.data() + begin);
        if (o > outer_blocks_[k] && at(outer_rows_[o - 1]) == i) {
          value += minus_outer(--o);
          value += outer_more_[o] * x[i];
        }
        if (i < smoothed_) x[i] = inverse_[i] * value;
        sum += product(b[i], x[i]);
      }
      return sum;
    });
  }

  /// body(k, begin, end) for each block and its rows.
  template <class Body>
  void for_each_block(const Context& context, Body&& body) const {
    context.parallel_for(block_count(), 8, [&](std::size_t first, std::size_t last) {
      for (std::size_t k = first; k < last; ++k) body(k, k * block, std::min(size(), (k + 1) * block));
    });
  }
  /// The sum of what body(k, begin, end) returns for each block, in their order.
  template <class Body>
  [[nodiscard]] double sum_of_blocks(const Context& context, Body&& body) const {
    std::vector<double> part(block_count());
    for_each_block(context, [&](std::size_t k, std::size_t begin, std::size_t end) { part[k] = body(k, begin, end); });
    double sum = 0;
    for (const double each : part) sum += each;
    return sum;
  }
  /// Real part of conj(a) b.
  [[nodiscard]] static double product(const K& a, const K& b) {
    return static_cast<double>(std::real(a)) * static_cast<double>(std::real(b)) +
           static_cast<double>(std::imag(a)) * static_cast<double>(std::imag(b));
  }

 private:
  using Local = std::uint16_t;  // places and counts within a block
  struct Row {
    Local left = 0, right = 0;  // entries on either side of the diagonal, within the block
    [[nodiscard]] std::size_t count() const { return std::size_t{left} + right; }
  };
  static_assert(block <= std::numeric_limits<Local>::max());

  [[nodiscard]] std::size_t block_count() const { return (size() + block - 1) / block; }
  // Minus the sum of `count` entries from e on, times what x holds from the start of their block.
  template <class X>
  K minus(std::size_t e, std::size_t count, const X* x) const {
    K sum{};
    for (const std::size_t end = e + count; e < end; ++e)
      subtract_product(sum, values_[e], static_cast<K>(x[columns_[e]]));
    return sum;
  }
  // Lays out what other blocks read of a block's rows.
  template <class X>
  void show(std::size_t k, const X* x) {
    for (std::size_t h = halo_blocks_[k]; h < halo_blocks_[k + 1]; ++h) halo_[h] = static_cast<K>(x[at(halo_rows_[h])]);
  }
  // Minus the sum of a row's entries outside its block, times what is laid out.
  K minus_outer(std::size_t o) const {
    K sum{};
    for (std::size_t e = outer_starts_[o]; e < outer_starts_[o + 1]; ++e)
      subtract_product(sum, outer_values_[e], halo_[at(outer_columns_[e])]);
    return sum;
  }
  void subtract_outer(std::span<K> r, const Context& context) const {
    for_each_block(context, [&](std::size_t k, std::size_t, std::size_t) {
      for (std::size_t o = outer_blocks_[k]; o < outer_blocks_[k + 1]; ++o) r[at(outer_rows_[o])] += minus_outer(o);
    });
  }

  std::size_t smoothed_ = 0;  // unknowns that the sweeps move; those after them are kept
  std::vector<Real> diagonal_, inverse_;
  std::vector<Row> rows_;
  std::vector<std::size_t> bases_{0};  // of each block in columns_
  std::vector<Local> columns_;         // within the block, without the diagonal, those left of it first
  std::vector<K> values_;
  std::vector<Index> outer_rows_;  // that have entries outside their block
  std::vector<std::size_t> outer_starts_{0}, outer_blocks_{0};
  std::vector<Index> outer_columns_;  // places in the halo: the rows that other blocks read, ascending
  std::vector<K> outer_values_;
  std::vector<Real> outer_more_;  // that sweeps add to the diagonal
  std::vector<Index> halo_rows_;
  std::vector<std::size_t> halo_blocks_{0};
  std::vector<K> halo_;
};

}  // namespace quadrig::detail
