// Quads: the mesh that comes out, its map back to the source surface, and its extraction from an integer-grid map.
#pragma once

#include <span>
#include <vector>

#include "quadrig/mesh.hpp"

namespace quadrig {

/// An all-quad mesh whose vertices lie on a source triangle mesh.
struct QuadMesh {
  Points<double> positions;          ///< n×3
  Quads quads;                       ///< m×4, counter-clockwise
  std::vector<SurfacePoint> source;  ///< n, where each vertex lies on the source surface

  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(positions.rows()); }
  [[nodiscard]] Index quad_count() const { return static_cast<Index>(quads.rows()); }
};

/// Whether a quad is folded over: its normal is against those of the faces that its corners lie on.
[[nodiscard]] inline bool turned_over(const TriangleMesh<double>& surface, const QuadMesh& mesh, Index quad) {
  const auto corner = [&](int i) { return Vector3(mesh.positions.row(mesh.quads(quad, i)).transpose()); };
  const Vector3 normal = (corner(2) - corner(0)).cross(corner(3) - corner(1));
  const double against = -0.5 * normal.norm();
  for (int i = 0; i < 4; ++i)
    if (!(normal.dot(surface.normal(mesh.source[static_cast<std::size_t>(mesh.quads(quad, i))].face)) < against))
      return false;
  return true;
}

/// The corners of the quads by vertex. \cost O(n + m)
class QuadCorners {
 public:
  explicit QuadCorners(const QuadMesh& mesh) : starts_(static_cast<std::size_t>(mesh.vertex_count()) + 1, 0) {
    const auto vertex = [&](Index corner) { return static_cast<std::size_t>(mesh.quads(corner / 4, corner % 4)); };
    for (Index c = 0; c < 4 * mesh.quad_count(); ++c) ++starts_[vertex(c) + 1];
    for (std::size_t v = 1; v < starts_.size(); ++v) starts_[v] += starts_[v - 1];
    corners_.resize(starts_.back());
    std::vector<std::size_t> next(starts_.begin(), starts_.end() - 1);
    for (Index c = 0; c < 4 * mesh.quad_count(); ++c) corners_[next[vertex(c)]++] = c;
  }

  /// Corners 4 q + i that lie at v, ascending.
  [[nodiscard]] std::span<const Index> at(Index v) const {
    const auto i = static_cast<std::size_t>(v);
    return std::span(corners_).subspan(starts_[i], starts_[i + 1] - starts_[i]);
  }

 private:
  std::vector<std::size_t> starts_;
  std::vector<Index> corners_;
};

/// Least over the four corners of (e_next × e_prev)·n / (|e_next||e_prev|), n the unit normal at the bilinear centre;
/// −1 where an edge or the normal vanishes. In [−1, 1], 1 for a rectangle.
[[nodiscard]] inline double scaled_jacobian(const Points<double>& positions, const Eigen::Matrix<Index, 1, 4>& quad) {
  Vector3 p[4];
  for (int i = 0; i < 4; ++i) p[i] = positions.row(quad[i]).transpose();
  const Vector3 n = (p[2] - p[0]).cross(p[3] - p[1]);
  const double n_length = n.norm();
  double least = 1;
  for (int i = 0; i < 4; ++i) {
    const Vector3 e_next = p[(i + 1) % 4] - p[i], e_prev = p[(i + 3) % 4] - p[i];
    const double scale = e_next.norm() * e_prev.norm() * n_length;
    if (!(scale > 0)) return -1;
    least = std::min(least, e_next.cross(e_prev).dot(n) / scale);
  }
  return least;
}

}  // namespace quadrig
