// Points spread evenly over a surface, and how far two surfaces are apart.
#pragma once

#include <random>

#include "quadrig/closest.hpp"
#include "quadrig/quality/statistics.hpp"

namespace quadrig {

/// Polygons cut into triangles from their first corner on: k − 2 triangles a polygon, in order. \cost O(corners)
[[nodiscard]] Triangles fan_triangles(const PolygonMesh& mesh);

/// `count` points spread over the triangles by area: one at random in each of `count` equal shares of the area. The
/// same points for the same seed on every machine. Nothing where the area is zero.
/// \pre indices in range, count ≥ 0. \cost O(m + count). \fails never.
[[nodiscard]] std::vector<SurfacePoint> sample_surface(const Points<double>& positions, const Triangles& faces,
                                                       Index count, std::uint64_t seed);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void sample_surface(const Arguments&...) = delete;  // see with_columns

/// Where points of a triangle surface are, a row each. \cost O(points)
[[nodiscard]] Points<double> positions_at(const Points<double>& positions, const Triangles& faces,
                                          std::span<const SurfacePoint> points);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void positions_at(const Arguments&...) = delete;  // see with_columns

/// Distances of points from a surface, in the units of the mesh.
struct DistanceFigures {
  double maximum = 0, mean = 0, rms = 0;
};
struct SurfaceDistance {
  DistanceFigures to_input;    ///< from the quads to the input: large where they bulge
  DistanceFigures from_input;  ///< from the input to the quads: large where parts are missing
  /// The larger maximum: the Hausdorff distance, estimated at the samples.
  [[nodiscard]] double hausdorff() const { return std::max(to_input.maximum, from_input.maximum); }
};

struct DistanceOptions {
  Index samples = 50000;  ///< a surface, in addition to all its vertices
  std::uint64_t seed = 7;

  /// \fails bad_option, names the field.
  [[nodiscard]] QUADRIG_INLINE Status validate() const;
};

/// Distances both ways between two surfaces of triangles, at their vertices and at samples; means over the samples
/// alone. \pre indices in range. \cost O((m + samples) log m). \fails bad_option by validate(); bad_input where one
/// of them has no area; cancelled
[[nodiscard]] Expected<SurfaceDistance> surface_distance(const Points<double>& input_positions,
                                                         const Triangles& input_faces, const Points<double>& positions,
                                                         const Triangles& faces, const DistanceOptions& options,
                                                         Context& context);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void surface_distance(const Arguments&...) = delete;  // see with_columns
/// The same for quads, cut along the diagonal of their first corner.
[[nodiscard]] inline Expected<SurfaceDistance> surface_distance(const TriangleMesh<double>& input, const QuadMesh& mesh,
                                                                const DistanceOptions& options, Context& context) {
  return surface_distance(input.positions(), input.faces(), mesh.positions, fan_triangles(to_polygons(mesh)), options,
                          context);
}

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quality/distance.ipp"
#endif
