// A fill-reducing order of elimination for the systems of surfaces. Knows no mesh: the pattern alone.
#pragma once

#include "quadrig/sparse.hpp"

namespace quadrig {

struct DissectionOptions {
  /// Pieces of at most this many unknowns are ordered by minimum degree. 0: 160, and 3000 of more than 300,000, where
  /// it saves a third of the time for a twentieth more fill.
  Index leaf = 0;
  double slack = 0.2;  ///< a separator may lie anywhere within this share of the unknowns from the middle
};

/// The unknowns in the order in which to eliminate them: nested dissection of the pattern, with separators that are
/// minimum cuts within a band across each piece, and constrained minimum degree within the leaves.
/// The same at any number of threads; any order once the context is cancelled. \pre a sound view; values are not read
/// \cost O(n log n) on almost planar patterns of bounded degree; others are ordered too, only later. \fails never
/// Source: George 1973; cuts as in Schild and Sommer, On balanced separators in road networks, 2015, with distances in
/// the pattern for coordinates; leaves as in Pellegrini, Roman and Amestoy, Hybridizing nested dissection and halo
/// approximate minimum degree, 2000.
[[nodiscard]] std::vector<Index> nested_dissection(Index size, std::span<const Index> column_starts,
                                                   std::span<const Index> rows, const DissectionOptions& options,
                                                   Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/solver/dissection.ipp"
#endif
