// Catmull-Clark subdivision of quads: what a renderer makes of a cage, as sums of the cage's vertices.
#pragma once

#include <span>

#include "quadrig/quads.hpp"
#include "quadrig/sparse.hpp"

namespace quadrig {

struct SubdivisionOptions {
  int levels = 2;
  /// Vertices where the limit surface has them; false: where `levels` steps leave them.
  bool limit = true;
  std::span<const std::array<Index, 2>> creases;  ///< edges of the cage that stay sharp

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate() const;
};

/// Borders are the cubic splines of their vertices; a border vertex of one quad alone stays, as does one where a crease
/// ends at a border (OpenSubdiv's "edge and corner", Blender's "keep corners").
struct Subdivision {
  Quads quads;                ///< 4^levels of each quad of the cage
  std::vector<Index> parent;  ///< of each of these
  std::vector<Index> vertex;  ///< of each vertex of the cage the one that it becomes
  /// vertices × vertices of the cage, each row with sum 1: positions, weights and displacements of the subdivided mesh
  /// are this times those of the cage.
  Eigen::SparseMatrix<double, Eigen::RowMajor, Index> stencils;
};

/// Whether this build can subdivide: it needs OpenSubdiv (QUADRIG_WITH_OPENSUBDIV).
[[nodiscard]] QUADRIG_INLINE bool can_subdivide();

/// \pre quads are a manifold of vertices below `vertex_count`. \cost O(4^levels · quads)
/// \fails unsupported where the build has no OpenSubdiv; bad_input where that rejects the quads
[[nodiscard]] QUADRIG_INLINE Expected<Subdivision> subdivide(const Quads& quads, Index vertex_count,
                                                             const SubdivisionOptions& options = {});

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/subdivision.ipp"
#endif
