// Orders of elimination that keep a sparse factor small, and the choice between them.
#pragma once

#include "quadrig/solver/dissection.hpp"
#include "quadrig/solver/minimum_degree.hpp"

namespace quadrig {

enum class Ordering : std::uint8_t {
  automatic,          ///< minimum degree, or dissection where the factorization is worth it
  minimum_degree,     ///< Eigen's approximate minimum degree: quickest to find
  nested_dissection,  ///< solver/dissection.hpp: least work on large surfaces
};

[[nodiscard]] constexpr std::string_view ordering_name(Ordering ordering) {
  return ordering == Ordering::minimum_degree      ? "minimum degree"
         : ordering == Ordering::nested_dissection ? "nested dissection"
                                                   : "automatic";
}

struct EliminationOrder {
  std::vector<Index> unknowns;  ///< the k-th to be eliminated
  Ordering ordering = Ordering::minimum_degree;
  /// Multiplications of the numeric factorization; 0 if the size alone decided.
  double multiplications = 0;
};

/// An order for a pattern (the lower triangle by columns, as in HermitianView). Automatic compares by exact counts.
/// \cost minimum degree about 0.4 µs an unknown on surfaces, dissection three times that. \fails never
[[nodiscard]] EliminationOrder elimination_order(Index size, std::span<const Index> column_starts,
                                                 std::span<const Index> rows, Ordering ordering, Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/solver/ordering.ipp"
#endif
