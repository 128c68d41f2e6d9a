// What of a surface its quads leave out: how far its points are from them, and how far they are from it.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/quads.hpp"

namespace quadrig {

/// Lengths in units of the mesh.
struct Coverage {
  double farthest = 0;              ///< of points of the surface from the quads
  Vector3 place = Vector3::Zero();  ///< the farthest of them
  double share_beyond = 0;          ///< of the surface's area: farther from the quads than the bound
};
/// How far quads are from the surface, at their corners and centres.
struct Stray {
  double farthest = 0;              ///< a length
  Vector3 place = Vector3::Zero();  ///< a point of the quads
};

/// Distances of points from triangles, one after the other: near points are answered fast, as the last answer bounds
/// the next.
class NearbyDistance {
 public:
  /// Keeps references to all three. \param faces rows of `triangles` that `tree` was made of
  NearbyDistance(const ClosestPoint& tree, const Points<double>& positions, const Triangles& triangles)
      : tree_(tree), positions_(positions), triangles_(triangles) {}

  /// The closest point, with its triangle. \pre the tree is not empty
  [[nodiscard]] SurfaceHit operator()(const Vector3& p) {
    SurfaceHit bound;
    if (last_ != no_index) {
      bound = closest_on_triangle(p, corner(0), corner(1), corner(2));
      bound.face = last_;
    }
    ClosestFilter filter;
    filter.maximum_distance = std::sqrt(bound.squared_distance);
    const SurfaceHit hit = tree_.closest(p, filter);
    if (!hit.found()) return bound;
    last_ = hit.face;
    return hit;
  }

 private:
  [[nodiscard]] Vector3 corner(int i) const { return positions_.row(triangles_(last_, i)).transpose(); }

  const ClosestPoint& tree_;
  const Points<double>& positions_;
  const Triangles& triangles_;
  Index last_ = no_index;
};

/// Barycentric coordinates that spread any count of points evenly over a triangle: the additive recurrence of the
/// plastic number over the square, of which half is folded.
class SpreadPoints {
 public:
  [[nodiscard]] Vector3 next() {
    constexpr double plastic = 1.32471795724474602596;
    u_ += 1 / plastic, u_ -= std::floor(u_);
    v_ += 1 / (plastic * plastic), v_ -= std::floor(v_);
    const bool folded = u_ + v_ > 1;
    const double x = folded ? 1 - u_ : u_, y = folded ? 1 - v_ : v_;
    return {1 - x - y, x, y};
  }

 private:
  double u_ = 0.5, v_ = 0.5;
};

/// Both halves of each quad, cut along the diagonal of its first corner, as triangles 2 q and 2 q + 1.
[[nodiscard]] inline Triangles quad_halves(const Quads& quads) {
  Triangles halves(2 * quads.rows(), 3);
  for (Eigen::Index q = 0; q < quads.rows(); ++q) {
    halves.row(2 * q) << quads(q, 0), quads(q, 1), quads(q, 2);
    halves.row(2 * q + 1) << quads(q, 0), quads(q, 2), quads(q, 3);
  }
  return halves;
}

/// How well quads cover some faces of a surface: seen at all vertices of the faces, and at points spread over the large
/// ones, four to a square of the bound.
/// \param bound a length, of `share_beyond`
/// \param of_vertex a distance a vertex of the mesh, written for those of the faces; or empty
/// \pre faces of the mesh; at least one quad; bound > 0
/// \cost O((vertices + quads) log quads). Invalid once cancelled.
[[nodiscard]] Coverage coverage(const TriangleMesh<double>& mesh, std::span<const Index> faces,
                                const Points<double>& positions, const Quads& quads, double bound,
                                const Context& context, std::span<double> of_vertex = {});

/// How far the quads [first, first + count) stray from the surface, found from their sources along it; where that is
/// more than the bound, anywhere on the faces.
/// \pre sources are on the mesh, near the vertices \cost O(count), or O(faces log faces) where one strays
[[nodiscard]] Stray stray(const TriangleMesh<double>& mesh, std::span<const Index> faces, const QuadMesh& quads,
                          Index first, Index count, double bound, const Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quality/coverage.ipp"
#endif
