// Definitions of solver/minimum_degree.hpp.
#pragma once

#include <Eigen/OrderingMethods>

#include "quadrig/solver/minimum_degree.hpp"

namespace quadrig {

QUADRIG_INLINE std::vector<Index> detail::minimum_degree(Index size, std::span<const Index> column_starts,
                                                         std::span<const Index> rows) {
  Eigen::SparseMatrix<float, Eigen::ColMajor, Index> pattern(size, size);
  pattern.resizeNonZeros(static_cast<Eigen::Index>(rows.size()));
  std::copy(column_starts.begin(), column_starts.end(), pattern.outerIndexPtr());
  std::copy(rows.begin(), rows.end(), pattern.innerIndexPtr());
  std::fill_n(pattern.valuePtr(), rows.size(), 1.0f);
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index> elimination;
  Eigen::AMDOrdering<Index>()(pattern.selfadjointView<Eigen::Lower>(), elimination);
  return {elimination.indices().data(), elimination.indices().data() + size};
}

}  // namespace quadrig
