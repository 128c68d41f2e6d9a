// Definitions of solver/ordering.hpp.
#pragma once

#include "quadrig/solver/ordering.hpp"
#include "quadrig/solver/symbolic.hpp"

namespace quadrig {

QUADRIG_INLINE EliminationOrder elimination_order(Index size, std::span<const Index> column_starts,
                                                  std::span<const Index> rows, Ordering ordering, Context& context) {
  const auto work = [&](std::span<const Index> order) {
    return detail::SymbolicBuilder(size, column_starts, rows, &context).multiplications(order);
  };
  EliminationOrder best;
  // Minimum degree cannot be cancelled, and dissection is better on surfaces of this size.
  const bool dissect =
      ordering == Ordering::nested_dissection || (ordering == Ordering::automatic && size > detail::large_system);
  if (!dissect) {
    best.unknowns = detail::minimum_degree(size, column_starts, rows);
    constexpr Index always_small = 20'000;
    if (ordering == Ordering::automatic && size < always_small) return best;
    best.multiplications = work(best.unknowns);
    // Below this a dissection costs more than it saves in the few factorizations that an analysis serves.
    constexpr double worth_dissection = 4000;
    if (ordering == Ordering::minimum_degree || best.multiplications < worth_dissection * size) return best;
  }
  EliminationOrder dissected{nested_dissection(size, column_starts, rows, {}, context), Ordering::nested_dissection, 0};
  if ((dissect && ordering == Ordering::automatic) || context.cancelled()) return dissected;
  dissected.multiplications = work(dissected.unknowns);
  return !dissect && best.multiplications < dissected.multiplications ? best : dissected;
}

}  // namespace quadrig
