// A Hermitian matrix by rows, in the order of elimination: for iterations that a factor preconditions.
#pragma once

#include <memory>

#include "quadrig/sparse.hpp"

namespace quadrig::detail {

/// All entries of a Hermitian matrix, its rows and columns as they are eliminated, so that neighbours lie together and
/// rows can be multiplied side by side. Copies share the pattern.
template <class K>
class OrderedRows {
 public:
  /// Row k is that of the unknown order[k]. The values of A are not read. Invalid once the context is cancelled.
  /// \pre a permutation. \cost O(nonzeros)
  void analyze(const HermitianView<K>& A, std::span<const Index> order, const Context& context) {
    auto pattern = std::make_shared<Pattern>();
    const auto n = order.size();
    std::vector<Index> position(n);
    for (std::size_t k = 0; k < n; ++k) position[at(order[k])] = static_cast<Index>(k);
    pattern->starts.assign(n + 1, 0);
    const auto for_each_entry = [&](auto&& body) {  // body(entry, its row, its column)
      for (std::size_t k = 0; k < n && !(k % 65536 == 0 && context.cancelled()); ++k)
        for (std::size_t e = at(A.column_starts[at(order[k])]); e < at(A.column_starts[at(order[k]) + 1]); ++e)
          body(e, at(position[at(A.rows[e])]), k);
    };
    for_each_entry([&](std::size_t, std::size_t i, std::size_t j) {
      ++pattern->starts[i + 1];
      if (i != j) ++pattern->starts[j + 1];
    });
    for (std::size_t k = 0; k < n; ++k) pattern->starts[k + 1] += pattern->starts[k];
    pattern->columns.resize(pattern->starts[n]);
    pattern->given.resize(pattern->starts[n]);
    std::vector<std::size_t> next(pattern->starts.begin(), pattern->starts.end() - 1);
    const auto add = [&](std::size_t row, std::size_t column, Index given) {
      pattern->columns[next[row]] = static_cast<Index>(column);
      pattern->given[next[row]++] = given;
    };
    for_each_entry([&](std::size_t e, std::size_t i, std::size_t j) {
      add(i, j, static_cast<Index>(e));
      if (i != j) add(j, i, -1 - static_cast<Index>(e));
    });
    pattern_ = std::move(pattern);
  }

  /// \pre the pattern of the last analyze
  void fill(std::span<const K> values, const Context& context) {
    values_.resize(pattern_->given.size());
    context.parallel_for(values_.size(), 65536, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        const Index given = pattern_->given[e];
        values_[e] = given >= 0 ? values[at(given)] : conjugate(values[at(-1 - given)]);
      }
    });
  }
  /// The values as they were given to `fill`.
  [[nodiscard]] std::vector<K> given_values() const {
    std::vector<K> values((values_.size() + size()) / 2);
    for (std::size_t e = 0; e < values_.size(); ++e)
      if (const Index given = pattern_->given[e]; given >= 0) values[at(given)] = values_[e];
    return values;
  }

  [[nodiscard]] std::size_t size() const { return pattern_->starts.size() - 1; }
  /// Row k of A x.
  [[nodiscard]] K row_times(std::size_t k, std::span<const K> x) const {
    K sum{};
    for (std::size_t e = pattern_->starts[k]; e < pattern_->starts[k + 1]; ++e)
      add_product(sum, values_[e], x[at(pattern_->columns[e])]);
    return sum;
  }

 private:
  struct Pattern {
    std::vector<std::size_t> starts;
    std::vector<Index> columns;
    std::vector<Index> given;  // which of the given entries each is; −1 − that where it is to be conjugated
  };

  std::shared_ptr<const Pattern> pattern_;
  std::vector<K, Untouched<K>> values_;
};

}  // namespace quadrig::detail
