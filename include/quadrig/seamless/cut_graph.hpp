// Combing of the frames, the cut graph that opens the surface to a disc, and each corner's chart relative to its
// vertex.
#pragma once

#include "quadrig/mesh.hpp"
#include "quadrig/seamless/elimination.hpp"

namespace quadrig {

/// How the charts of a connected surface hang together. Parameter z = U + iV per corner; across half-edge h, from its
/// face to the face of its twin, z' = i^rotation(h) z + t, with t = 0 off the cut and one translation per branch on it.
struct CutGraph {
  std::vector<std::int8_t> combing;   ///< per face: its frame is turned by this many quarter turns
  std::vector<std::int8_t> rotation;  ///< per half-edge after combing, 0..3; 0 off the cut
  std::vector<Index> branch;          ///< per half-edge; no_index off the cut
  std::vector<std::int8_t> forward;   ///< per half-edge on the cut: 1 where it runs with its branch
  Index branch_count = 0;
  std::vector<std::int8_t> node;  ///< per vertex: 1 where branches end or meet, and at singular vertices

  /// Corner (half-edge) h of vertex v: z_h = i^corner_rotation[h] z_v + Σ coefficient · t_branch.
  std::vector<std::int8_t> corner_rotation;
  std::vector<LinearExpression<Gaussian>> corner_translation;  ///< over branches; empty nearly everywhere
  /// Per node: Σ over branches that, with (i^turn − 1) z_v, has to vanish once around an interior vertex.
  struct Closing {
    Index vertex;
    std::int8_t turn;
    LinearExpression<Gaussian> translation;
  };
  std::vector<Closing> closings;
};

/// \pre `mesh` is connected; `rotation` is the matching (vector k of a face is vector k + r of the face across), twins
///   negated; `index` is the cone index I4 per vertex.
/// \cost O(m log m). Incomplete once the context is cancelled.
[[nodiscard]] QUADRIG_INLINE CutGraph make_cut_graph(const TriangleMesh<double>& mesh,
                                                     const std::vector<std::int8_t>& rotation,
                                                     const std::vector<Index>& index, const Context* context = nullptr);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/seamless/cut_graph.ipp"
#endif
