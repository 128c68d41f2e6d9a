// Quads of a map of one's own: vertices, faces and corner coordinates in, quads out.
#pragma once

#include "quadrig/quads/integer_map.hpp"
#include "quadrig/seamless/from_uv.hpp"

namespace quadrig {

struct UvQuadsOptions {
  UvOptions uv;
  /// How many quads; 0: the grid of the map as it is where it is an integer-grid map, else as many as its area.
  double quads = 0;
  double tolerance = 0.05;  ///< of the count, where integers have to be found

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate(const TriangleMesh<double>& mesh) const;
};

struct UvQuads {
  QuadMesh mesh;          ///< `source`: where each vertex lies on the triangles
  bool own_grid = false;  ///< the quads are those of the given grid; else integers were found for it
};

/// A seamless map as it is, in exact fixed point, where it is an integer-grid map.
/// \cost O(m)
/// \fails bad_input, naming the vertex or edge, where a cone lies on no grid point, a grid line at no whole coordinate,
/// or
///   a translation is not whole, by more than `tolerance` of a quad
[[nodiscard]] QUADRIG_INLINE Expected<GridMap> whole_grid(const TriangleMesh<double>& mesh, const SeamlessMap& map,
                                                          double tolerance = 0.02);

/// Quads along the grid lines of a seamless parametrization: those of its grid where it is an integer-grid map, else of
/// the nearest one that has about as many. They are not polished.
/// \pre `mesh` is one component
/// \cost seamless_from_uv; integer_map where the grid is not whole
/// \fails bad_input where the mesh is in parts; as seamless_from_uv, integer_map and extract; cancelled.
/// Source: what QEx extracts (Ebke et al. 2013), on maps that need not be integer yet.
[[nodiscard]] QUADRIG_INLINE Expected<UvQuads> quads_from_uv(const TriangleMesh<double>& mesh, const CornerUv& uv,
                                                             const UvQuadsOptions& options, Context& context);

/// The same of plain matrices. \param vertices n×3 \param faces m×3 \param uv k×2 \param face_uv m×3, rows of `uv`
/// \fails bad_input where the triangles are no oriented manifold, too
[[nodiscard]] QUADRIG_INLINE Expected<UvQuads> quads_from_uv(const Eigen::MatrixXd& vertices,
                                                             const Eigen::MatrixXi& faces, const Eigen::MatrixXd& uv,
                                                             const Eigen::MatrixXi& face_uv,
                                                             const UvQuadsOptions& options, Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quads/from_uv.ipp"
#endif
