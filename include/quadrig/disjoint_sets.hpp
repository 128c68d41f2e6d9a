// Disjoint sets of numbers: what hangs together.
#pragma once

#include <algorithm>

#include "quadrig/core.hpp"

namespace quadrig {

/// Sets of the numbers [0, n), each alone at first; the lowest member represents its set.
/// \cost O(log n) an operation, near 1 in practice. Source: Tarjan 1975, by path halving.
class DisjointSets {
 public:
  /// \pre n ≤ 2^31
  explicit DisjointSets(std::size_t n) : parent_(n) {
    for (std::size_t i = 0; i < n; ++i) parent_[i] = static_cast<Index>(i);
  }

  [[nodiscard]] std::size_t size() const { return parent_.size(); }
  /// The lowest member of the set of i, in the type of i. \pre i in [0, size)
  template <class Number>
  [[nodiscard]] Number find(Number i) {
    auto at = static_cast<Index>(i);
    while (parent_[detail::at(at)] != at) {
      Index& up = parent_[detail::at(at)];
      up = parent_[detail::at(up)];
      at = up;
    }
    return static_cast<Number>(at);
  }
  /// Makes the sets of a and b one. Returns false where they were one already.
  template <class Number>
  bool join(Number a, Number b) {
    a = find(a), b = find(b);
    if (a == b) return false;
    parent_[static_cast<std::size_t>(std::max(a, b))] = static_cast<Index>(std::min(a, b));
    return true;
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace quadrig
