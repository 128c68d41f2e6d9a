// Counts, topology and shape of polygons.
#pragma once

#include "quadrig/prepare.hpp"
#include "quadrig/quads.hpp"
#include "quadrig/quantile.hpp"

namespace quadrig {

/// The quads as polygons, positions included. \cost O(m)
[[nodiscard]] PolygonMesh to_polygons(const QuadMesh& mesh);
/// The triangles as polygons, positions included. \cost O(m)
[[nodiscard]] PolygonMesh to_polygons(const TriangleMesh<double>& mesh);

/// Counts of any polygon mesh, sound or not. A component is what faces join through shared vertices.
struct MeshStatistics {
  Index vertices = 0;  ///< used by a face
  Index faces = 0, quads = 0, triangles = 0, ngons = 0;
  /// Interior vertices of edge valence other than 4 and boundary vertices of edge valence other than 3 (so the corner
  /// of a quad patch counts); vertices on an edge of three or more faces are left out.
  Index irregular = 0;
  Index irregular_interior = 0;  ///< the interior part of `irregular`
  Index components = 0;
  /// Summed over the components; nothing where the surface is not an oriented manifold.
  std::optional<Index> genus;
  Index euler = 0;                                                  ///< V − E + F
  Index boundary_edges = 0;                                         ///< with one face
  Index boundary_loops = 0;                                         ///< connected sets of boundary edges
  Index nonmanifold_edges = 0;                                      ///< with three faces or more
  Index nonmanifold_vertices = 0;                                   ///< whose faces form more than one fan
  Index misoriented_edges = 0;                                      ///< with two faces that run them the same way
  Index degenerate_faces = 0;                                       ///< with a repeated vertex
  Index duplicate_faces = 0;                                        ///< on a set of vertices that has been seen before
  double scaled_jacobian_average = 0, scaled_jacobian_minimum = 0;  ///< over the quads; 0 without quads
  double scaled_jacobian_negative = 0;                              ///< share of the quads below 0, in [0, 1]
};

/// \pre corners are vertices of the mesh. \cost O(corners log corners). \fails never.
[[nodiscard]] MeshStatistics mesh_statistics(const PolygonMesh& mesh);
[[nodiscard]] inline MeshStatistics mesh_statistics(const QuadMesh& mesh) { return mesh_statistics(to_polygons(mesh)); }

/// Shapes of quads. Percentiles are interpolated between samples.
struct ShapeStatistics {
  double aspect_mean = 0, aspect_p99 = 0,
         aspect_maximum = 0;   ///< longer by shorter line between opposite edges' middles
  double edge_ratio_mean = 0;  ///< longest by shortest edge of a quad
  double angle_error_mean_degrees = 0, angle_error_p99_degrees = 0,
         angle_error_maximum_degrees = 0;  ///< from 90°, by corner
  double area_p99_by_p1 = 0;               ///< of the areas (half the norm of the diagonals' cross product)
};

/// \pre corners are vertices of the mesh. \cost O(m log m). \fails never; zeros without quads.
[[nodiscard]] ShapeStatistics shape_statistics(const Points<double>& positions, const Quads& quads);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void shape_statistics(const Arguments&...) = delete;  // see with_columns

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quality/statistics.ipp"
#endif
