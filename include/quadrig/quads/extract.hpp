// Quads from an integer-grid map, in exact integer arithmetic: from the centre of each unit square, walk to its
// corners.
#pragma once

#include "quadrig/quads.hpp"
#include "quadrig/seamless/gaussian.hpp"

namespace quadrig {

/// Triangles with corners in fixed point: one unit square of the grid is `unit` wide (an even number). Across
/// half-edge h the chart changes by z' = i^rotation z + t with t a multiple of `unit`.
struct GridMap {
  std::vector<Index> origin;  ///< per half-edge
  std::vector<Index> twin;    ///< per half-edge, no_index on the border
  std::vector<std::int8_t> rotation;
  std::vector<Gaussian> corner;
  std::int64_t unit = 2;

  [[nodiscard]] Index face_count() const { return static_cast<Index>(origin.size() / 3); }
};

/// A vertex of the extracted quads: a face of the grid map and barycentric coordinates in it.
struct ExtractedQuads {
  Quads quads;
  std::vector<SurfacePoint> vertices;
  std::vector<Index> mesh_vertex;  ///< the vertex of the map that a quad vertex coincides with, or no_index
};

/// Every transition of the map is exact on both ends of every edge, and every triangle is positive.
[[nodiscard]] QUADRIG_INLINE bool grid_map_exact(const GridMap& map);

/// \pre grid_map_exact(map), cones right, singular vertices on grid points
/// \cost O(m + quads · triangles a quad crosses)
/// \fails stage_failed where the map is not an integer-grid map.
[[nodiscard]] QUADRIG_INLINE Expected<ExtractedQuads> extract_quads(const GridMap& map, std::size_t quad_limit);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quads/extract.ipp"
#endif
