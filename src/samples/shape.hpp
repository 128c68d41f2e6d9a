// A closed shape as the zero of a function, and what is built on its surface.
#pragma once

#include <functional>

#include "quadrig/asset.hpp"

namespace quadrig::samples {

/// About the signed distance to the surface, negative inside; the gradient is written.
using Distance = std::function<double(const Vector3& p, Vector3& gradient)>;

/// A plane across an axis whose curve on the surface stays a line of edges.
struct KeptPlane {
  int axis;
  double at;
};

struct Shape {
  Distance distance;
  Vector3 low, high;  ///< a box around the surface
  double cell;        ///< lattice step that no limb slips through
  std::vector<KeptPlane> kept = {};
  bool mirrored = false;  ///< in x = 0, which is one of `kept`: so is the mesh
  /// Length of edges at a point, relative to others.
  std::function<double(const Vector3& p)> grading = {};
  Skeleton skeleton;
  /// Distance from a point of the surface to the limb of a bone: the least one says whose limb the point lies on.
  std::function<double(Index bone, const Vector3& p)> limb_distance = {};
  /// Where weights are known at every point, one a bone.
  std::function<Eigen::RowVectorXd(const Vector3& p)> weights = {};
};

/// Moves a point onto the surface by Newton steps along the gradient.
[[nodiscard]] Vector3 project(const Shape& shape, Vector3 p, int steps);

/// Which of the kept planes the point lies on exactly, a bit each.
[[nodiscard]] std::uint8_t planes_at(const Shape& shape, const Vector3& p);
/// Moves a point onto the surface without leaving the planes.
[[nodiscard]] Vector3 project_within(const Shape& shape, std::uint8_t planes, Vector3 p, int steps);
/// A number for each face: equal where faces hang together without an edge of a kept plane between them.
[[nodiscard]] std::vector<Index> plane_regions(const Shape& shape, const TriangleMesh<double>& mesh);

/// A mesh of the surface with even edges, about as many triangles as asked.
[[nodiscard]] Expected<TriangleMesh<double>> surface_mesh(const Shape& shape, Index triangles, Context& context);

/// Every triangle in four, new vertices on the surface, then relaxed; `weights` (dense, one row a vertex) follow.
[[nodiscard]] Expected<TriangleMesh<double>> subdivide(const Shape& shape, const TriangleMesh<double>& mesh,
                                                       Eigen::MatrixXd& weights, Context& context);

/// Heat equilibrium weights, one row a vertex.
[[nodiscard]] Expected<Eigen::MatrixXd> heat_weights(const Shape& shape, const TriangleMesh<double>& mesh,
                                                     Context& context);

}  // namespace quadrig::samples
