// Integers that cannot collapse: edge vectors in Z[i] on the coarse map, every triangle positive and every cone right.
#pragma once

#include "quadrig/budget.hpp"
#include "quadrig/context.hpp"
#include "quadrig/quantize/coarse_map.hpp"

namespace quadrig {

struct QuantizeOptions {
  double target_quads = 2000;
  double tolerance = 0.05;  ///< of the count
  int rounds = 9;           ///< rescalings towards the count; the closest is kept
};

/// Integer edge vectors on a coarse map: opposite-consistent, closed over every triangle, positively oriented.
struct Quantization {
  std::vector<Gaussian> edge;  ///< per coarse half-edge, in the chart of its face
  double quads = 0;            ///< Σ det / 2: exact count of the quads to come
  double start_scale = 1;      ///< factor at which rounding became valid
  double energy = 0;           ///< Σ |ω − d|² / |d|²
  int moves = 0;
};

/// Quantizes a coarse map at the size that gives `target_quads`.
/// \fails stage_failed where no start is valid at any size tried, or none was found within the budget; cancelled.
/// \cost a Dijkstra search a strip moved, on the coarse map only, within the budget for the search: where that is spent
///   the best so far is taken.
[[nodiscard]] QUADRIG_INLINE Expected<Quantization> quantize(const CoarseMap& map, const std::vector<Index>& index,
                                                             const std::vector<char>& on_border,
                                                             const QuantizeOptions& options, Context& context,
                                                             Budget& budget);

/// With a budget of its own.
[[nodiscard]] inline Expected<Quantization> quantize(const CoarseMap& map, const std::vector<Index>& index,
                                                     const std::vector<char>& on_border, const QuantizeOptions& options,
                                                     Context& context) {
  Budget budget;
  return quantize(map, index, on_border, options, context, budget);
}

/// Integers with one strip of quads more through one of the faces, those first that differ least from the map.
/// \pre `from` are integers of the map for these options
/// \cost a Dijkstra search for each direction of each edge of the faces, within the budget for the search.
[[nodiscard]] QUADRIG_INLINE std::vector<Quantization> widened(const CoarseMap& map, const std::vector<Index>& index,
                                                               const std::vector<char>& on_border,
                                                               const QuantizeOptions& options, const Quantization& from,
                                                               std::span<const Index> faces, const Context& context,
                                                               Budget& budget);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quantize/quantize.ipp"
#endif
