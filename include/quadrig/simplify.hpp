// Quads without a map: the surface is simplified, its triangles are paired, and every polygon is split once. Many
// irregular vertices, but it succeeds on every manifold surface.
#pragma once

#include "quadrig/polish.hpp"
#include "quadrig/prepare.hpp"

namespace quadrig {

struct SplitOptions {
  Index quads = 2000;  ///< wanted number of quads, ≥ 1
  /// Weight of even spacing against closeness to the surface, ≥ 0: 0 puts all vertices where the surface is curved,
  /// 1 nearly ignores curvature.
  double uniformity = 0.05;
  /// Two triangles become one polygon only where none of its four quads has a smaller scaled Jacobian, in (0, 1).
  double pair_quality = 0.3;
  PolishOptions polish;  ///< rounds = 0 leaves the quads as they were split
  RefineOptions refine;  ///< bounds the memory that a coarse input may grow to

  /// \fails bad_option, names the field.
  [[nodiscard]] Status validate() const;
};

struct SplitReport {
  Index refined_faces = 0;      ///< faces of the surface before it was simplified
  Index triangles = 0;          ///< faces it was simplified to
  Index pairs = 0;              ///< pairs of them that became one polygon
  Index minimum_count = 0;      ///< above 0 where the surface allowed no fewer quads than this and fewer were wanted
  Index off_surface = 0;        ///< vertices that had to stay off the surface for a quad to stay valid
  double largest_distance = 0;  ///< of such a vertex to its source, units of the mesh
  double least_jacobian = 0, average_jacobian = 0;  ///< scaled
  double seconds = 0;
};

struct SplitQuads {
  QuadMesh mesh;
  SplitReport report;
};

/// Pure quads of the same topology as the mesh (components, boundary loops, Euler characteristic, orientation), all of
/// positive scaled Jacobian, about options.quads of them: 3 a triangle and 4 a pair of triangles, of a surface that
/// edges were collapsed from by quadric errors and never against the link condition. The corners of those triangles
/// are vertices of the (refined) input; what splits them is then moved onto the surface, on the boundary along the
/// boundary, as far as every quad stays valid, and polished. A quad that lies flat in its triangle is always valid, so
/// there is an answer for every surface; where the count cannot be had, the nearest.
///
/// \pre mesh has a face, and none of zero area: `prepare` sees to it
/// \fails bad_option; bad_input on a mesh without faces; cancelled.
/// \cost O(m log m) time for m input faces, about 600 m bytes.
/// Source: Garland and Heckbert, Surface simplification using quadric error metrics, 1997; link condition: Dey et al.,
/// Topology preserving edge contraction, 1999.
[[nodiscard]] QUADRIG_INLINE Expected<SplitQuads> split_quads(const TriangleMesh<double>& mesh,
                                                              const SplitOptions& options, Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/simplify/split.ipp"
#endif
