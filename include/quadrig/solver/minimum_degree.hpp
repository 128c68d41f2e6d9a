// Eigen's approximate minimum degree.
#pragma once

#include "quadrig/sparse.hpp"

namespace quadrig::detail {

/// The unknowns of a pattern (the lower triangle by columns, as in HermitianView) in the order in which to eliminate
/// them. \cost about 0.4 µs an unknown on surfaces; it cannot be stopped. \fails never
/// Source: Amestoy, Davis and Duff 1996.
[[nodiscard]] std::vector<Index> minimum_degree(Index size, std::span<const Index> column_starts,
                                                std::span<const Index> rows);

}  // namespace quadrig::detail

#if !defined(QUADRIG_COMPILED)
#include "quadrig/solver/minimum_degree.ipp"
#endif
