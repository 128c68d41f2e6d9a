// Normal equations with a few unknowns a vertex, where vertices of a patch are tied to each other.
#pragma once

#include "quadrig/sparse.hpp"

namespace quadrig::detail {

/// A sparse symmetric matrix of size×size blocks whose pattern is that of patches: every two vertices of one are tied.
template <int size>
class BlockEquations {
 public:
  using Block = Eigen::Matrix<double, size, size>;
  /// \param unknown of each vertex; no_index: does not move and has none; the same of several: they move as one
  /// \param patches vertices of each
  template <class Patches>
  BlockEquations(std::vector<Index> unknown, Index unknowns, const Patches& patches)
      : unknown_(std::move(unknown)), count_(unknowns) {
    std::vector<std::vector<Index>> below(at(unknowns));
    for (const auto& patch : patches)
      for (const Index v : patch)
        for (const Index w : patch) {
          const Index i = unknown_[at(v)], j = unknown_[at(w)];
          if (i == no_index || j == no_index || i < j) continue;
          below[at(j)].push_back(i);
        }
    first_.assign(1, 0);
    for (std::vector<Index>& rows : below) {
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      if (rows.empty()) rows.push_back(static_cast<Index>(&rows - below.data()));
      block_rows_.insert(block_rows_.end(), rows.begin(), rows.end());
      first_.push_back(block_rows_.size());
    }
    matrix_.size = size * unknowns;
    for (Index j = 0; j < unknowns; ++j)
      for (int c = 0; c < size; ++c) {
        for (std::size_t k = first_[at(j)]; k < first_[at(j) + 1]; ++k)
          for (int r = k == first_[at(j)] ? c : 0; r < size; ++r) matrix_.rows.push_back(size * block_rows_[k] + r);
        matrix_.column_starts.push_back(static_cast<Index>(matrix_.rows.size()));
      }
    matrix_.values.resize(matrix_.rows.size());
    rhs_.resize(at(size * unknowns));
  }

  void clear() {
    std::fill(matrix_.values.begin(), matrix_.values.end(), 0.0);
    std::fill(rhs_.begin(), rhs_.end(), 0.0);
  }
  [[nodiscard]] Index unknown(Index vertex) const { return unknown_[at(vertex)]; }
  [[nodiscard]] Index unknowns() const { return count_; }
  [[nodiscard]] HermitianView<double> matrix() const { return matrix_.view(); }
  [[nodiscard]] std::span<const double> rhs() const { return rhs_; }

  /// The block between v and w, once for both orders; for v = w its lower triangle alone is read.
  void add(Index v, Index w, const Block& block) {
    const Index i = unknown(v), j = unknown(w);
    if (i == no_index || j == no_index) return;
    if (i == j && v != w) {  // which share their unknown
      add(v, v, block + block.transpose());
      return;
    }
    if (i < j) {
      add(w, v, block.transpose());
      return;
    }
    const auto begin = block_rows_.begin() + static_cast<std::ptrdiff_t>(first_[at(j)]);
    const auto end = block_rows_.begin() + static_cast<std::ptrdiff_t>(first_[at(j) + 1]);
    const auto place = std::lower_bound(begin, end, i) - begin;
    for (int c = 0; c < size; ++c) {
      const auto start = at(matrix_.column_starts[at(size * j + c)]);
      if (place == 0)
        for (int r = c; r < size; ++r) matrix_.values[start + at(r - c)] += block(r, c);
      else
        for (int r = 0; r < size; ++r)
          matrix_.values[start + at(size - c + size * (static_cast<Index>(place) - 1) + r)] += block(r, c);
    }
  }
  void add(Index v, const Eigen::Matrix<double, size, 1>& right) {
    if (const Index i = unknown(v); i != no_index)
      for (int c = 0; c < size; ++c) rhs_[at(size * i + c)] += right[c];
  }

 private:
  std::vector<Index> unknown_;
  Index count_ = 0;
  std::vector<std::size_t> first_;  // of each block column
  std::vector<Index> block_rows_;   // ascending in a column, the diagonal first
  HermitianMatrix<double> matrix_;
  std::vector<double> rhs_;
};

}  // namespace quadrig::detail
