// Quads as a renderer draws them, two triangles each, and where points near them lie on these.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/quads.hpp"

namespace quadrig::detail {

/// A point on a triangle of drawn quads: triangles 2 q and 2 q + 1 are the halves of quad q.
struct Place {
  Index triangle = no_index;
  Vector3 barycentric = Vector3::Zero(), position = Vector3::Zero();
  double squared_distance = std::numeric_limits<double>::infinity();
};

/// Quads with a diagonal each. Positions move, the quads stay.
class DrawnQuads {
 public:
  /// \pre the quads are an oriented manifold
  explicit DrawnQuads(const QuadMesh& mesh)
      : quads_(mesh.quads), positions_(mesh.positions), corners_(mesh), diagonal_(at(mesh.quad_count()), 0) {
    const std::vector<SortedSide> sides = sorted_by_edge(mesh.vertex_count(), 4 * mesh.quad_count(), [&](Index c) {
      const Index a = quads_(c / 4, c % 4), b = quads_(c / 4, (c + 1) % 4);
      return SortedSide{std::min(a, b), std::max(a, b), c};
    });
    twin_.assign(4 * diagonal_.size(), no_index);
    for (std::size_t k = 0; k + 1 < sides.size(); ++k)
      if (sides[k].same_edge(sides[k + 1])) {
        twin_[at(sides[k].halfedge)] = sides[k + 1].halfedge;
        twin_[at(sides[k + 1].halfedge)] = sides[k].halfedge;
      }
  }

  [[nodiscard]] const Quads& quads() const { return quads_; }
  [[nodiscard]] Index quad_count() const { return static_cast<Index>(quads_.rows()); }
  [[nodiscard]] const Points<double>& positions() const { return positions_; }
  void set_positions(const Points<double>& positions) { positions_ = positions; }
  [[nodiscard]] const QuadCorners& corners() const { return corners_; }
  /// The side that shares its vertices with side 4 q + i, or no_index on a border.
  [[nodiscard]] Index twin(Index side) const { return twin_[at(side)]; }
  /// The corner, 0 or 1, that both halves begin with.
  [[nodiscard]] int diagonal(Index quad) const { return diagonal_[at(quad)]; }
  void set_diagonal(Index quad, int corner) { diagonal_[at(quad)] = static_cast<char>(corner); }

  [[nodiscard]] Vector3 position(Index vertex) const { return positions_.row(vertex).transpose(); }
  /// The corner of the quad, in [0, 4), that corner i of a triangle is, by the quad's diagonal.
  [[nodiscard]] static int corner(Index triangle, int i, int diagonal) {
    return (diagonal + (i == 0 ? 0 : i + triangle % 2)) % 4;
  }
  [[nodiscard]] int corner(Index triangle, int i) const { return corner(triangle, i, diagonal(triangle / 2)); }
  [[nodiscard]] Vector3 normal(Index triangle) const {
    const std::array<Vector3, 3> p = points(triangle);
    const Vector3 n = (p[1] - p[0]).cross(p[2] - p[0]);
    const double length = n.norm();
    return length > 0 ? Vector3(n / length) : Vector3::Zero();
  }

  [[nodiscard]] double area(Index triangle) const {
    const std::array<Vector3, 3> p = points(triangle);
    return (p[1] - p[0]).cross(p[2] - p[0]).norm() / 2;
  }
  [[nodiscard]] Vector3 point(Index triangle, const Vector3& barycentric) const {
    const std::array<Vector3, 3> p = points(triangle);
    return barycentric[0] * p[0] + barycentric[1] * p[1] + barycentric[2] * p[2];
  }
  [[nodiscard]] Place on(Index triangle, const Vector3& p) const {
    const std::array<Vector3, 3> q = points(triangle);
    const SurfaceHit hit = closest_on_triangle(p, q[0], q[1], q[2]);
    return {triangle, hit.barycentric, hit.position, hit.squared_distance};
  }
  /// Follows the quads from a triangle towards p, across the sides and corners where they come closer: a place from
  /// which no neighbour is closer, on the sheet where it began. \cost O(triangles passed)
  [[nodiscard]] Place walk(const Vector3& p, Index start) const {
    Place best = on(start, p);
    const auto consider = [&](Index quad) {
      for (const Index triangle : {2 * quad, 2 * quad + 1})
        if (const Place place = on(triangle, p); place.squared_distance < best.squared_distance) best = place;
    };
    for (Index before = no_index; best.triangle != before;) {
      before = best.triangle;
      const Place here = best;
      const int zeros =
          (here.barycentric.array() == 0).count() > 0 ? static_cast<int>((here.barycentric.array() == 0).count()) : 0;
      if (zeros == 0) break;
      const Index quad = before / 2;
      if (zeros == 2) {
        for (int i = 0; i < 3; ++i)
          if (here.barycentric[i] != 0)
            for (const Index c : corners_.at(quads_(quad, corner(before, i)))) consider(c / 4);
      } else {
        for (int i = 0; i < 3; ++i)
          if (here.barycentric[i] == 0) {
            // opposite corner i: the diagonal, or a side of the quad
            const int from = corner(before, (i + 1) % 3), to = corner(before, (i + 2) % 3);
            if ((from + 1) % 4 != to)
              consider(quad);
            else if (const Index across = twin(4 * quad + from); across != no_index)
              consider(across / 4);
          }
      }
    }
    return best;
  }

 private:
  [[nodiscard]] std::array<Vector3, 3> points(Index triangle) const {
    std::array<Vector3, 3> p;
    for (int i = 0; i < 3; ++i) p[static_cast<std::size_t>(i)] = position(quads_(triangle / 2, corner(triangle, i)));
    return p;
  }

  Quads quads_;
  Points<double> positions_;
  QuadCorners corners_;
  std::vector<Index> twin_;
  std::vector<char> diagonal_;
};

}  // namespace quadrig::detail
