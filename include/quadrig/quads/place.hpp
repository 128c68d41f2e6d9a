// Where the quads of a coarse map lie on the surface: straight lines in the flat metric of the fine seamless map.
#pragma once

#include "quadrig/quads/extract.hpp"
#include "quadrig/quantize.hpp"

namespace quadrig {

/// Points of the coarse triangulation found on the fine mesh. A coarse triangle is a straight triangle of the fine
/// map's flat metric, so each of its points is reached from one of its corners by a straight line; the direction is
/// known at the corner itself, as an angle of the fine fan.
class CoarsePlacement {
 public:
  /// \pre z are the corner parameters that `coarse` was decimated from
  CoarsePlacement(const TriangleMesh<double>& mesh, const CutGraph& cut, const std::vector<Complex>& z,
                  const CoarseMap& coarse)
      : mesh_(mesh), cut_(cut), z_(z), coarse_(coarse) {}

  /// \cost O(fine triangles crossed).
  [[nodiscard]] SurfacePoint operator()(const SurfacePoint& point) const {
    using detail::at;
    int nearest = 0;
    point.barycentric.maxCoeff(&nearest);
    const Index h = 3 * point.face + nearest;
    const Index prev = 3 * point.face + (nearest + 2) % 3;
    const Complex along = coarse_.vector[at(h)], back = -coarse_.vector[at(prev)];
    const Complex offset = point.barycentric[(nearest + 1) % 3] * along + point.barycentric[(nearest + 2) % 3] * back;
    const Index v = coarse_.origin[at(h)];
    if (std::abs(offset) <= 1e-12 * std::abs(along)) return corner_point(mesh_.outgoing(v));
    return trace(v, coarse_.direction[at(h)] + elementary::arg(offset / along), std::abs(offset));
  }

 private:
  [[nodiscard]] static SurfacePoint corner_point(Index h) {
    SurfacePoint point{h / 3, Vector3::Zero()};
    point.barycentric[h % 3] = 1;
    return point;
  }
  [[nodiscard]] Complex z(Index h) const { return z_[static_cast<std::size_t>(h)]; }
  [[nodiscard]] double angle(Index h) const {
    return elementary::arg((z(mesh_.prev(h)) - z(h)) / (z(mesh_.next(h)) - z(h)));
  }

  /// Straight from vertex v at an angle of its fan, for a length in the map.
  [[nodiscard]] SurfacePoint trace(Index v, double direction, double length) const {
    double total = 0;
    Index h = mesh_.outgoing(v);
    const Index start = h;
    do {
      total += angle(h);
      h = mesh_.next_around(h);
    } while (h != no_index && h != start);
    const bool border = mesh_.on_boundary(v);
    if (border)
      direction = std::clamp(direction, 0.0, total);
    else
      direction -= total * std::floor(direction / total);
    h = start;
    double sector = angle(h);
    while (direction > sector) {
      const Index after = mesh_.next_around(h);
      if (after == no_index || after == start) break;
      direction -= sector;
      h = after;
      sector = angle(h);
    }
    direction = std::min(direction, sector);
    const Complex unit =
        elementary::polar(1.0, direction) * (z(mesh_.next(h)) - z(h)) / std::abs(z(mesh_.next(h)) - z(h));
    Complex from = z(h), to = from + length * unit;
    Index f = h / 3, entry = no_index;
    for (Index steps = 0; steps < 4 * mesh_.face_count(); ++steps) {
      const Complex p[3] = {z(3 * f), z(3 * f + 1), z(3 * f + 2)};
      const double area = cross(p[1] - p[0], p[2] - p[0]);
      double inside[3];
      for (int e = 0; e < 3; ++e) inside[e] = cross(p[(e + 1) % 3] - p[e], to - p[e]) / area;
      // Leave by the edge that the segment reaches first among those it has to cross.
      Index exit = no_index;
      double soonest = std::numeric_limits<double>::infinity();
      for (int e = 0; e < 3; ++e) {
        if (3 * f + e == entry || inside[e] >= -1e-12) continue;
        const double here = cross(p[(e + 1) % 3] - p[e], from - p[e]) / area;
        const double t = here <= 0 ? 0 : here / (here - inside[e]);
        if (t < soonest) {
          soonest = t;
          exit = 3 * f + e;
        }
      }
      const Index across = exit == no_index ? no_index : mesh_.twin(exit);
      if (across == no_index) {
        SurfacePoint point{f, Vector3::Zero()};
        for (int e = 0; e < 3; ++e) point.barycentric[(e + 2) % 3] = std::max(0.0, inside[e]);
        point.barycentric /= point.barycentric.sum();
        return point;
      }
      const int r = cut_.rotation[static_cast<std::size_t>(exit)];
      const Complex t = z(mesh_.next(across)) - rotated(z(exit), r);
      from = rotated(from, r) + t;
      to = rotated(to, r) + t;
      entry = across;
      f = across / 3;
    }
    return corner_point(start);
  }

  const TriangleMesh<double>& mesh_;
  const CutGraph& cut_;
  const std::vector<Complex>& z_;
  const CoarseMap& coarse_;
};

}  // namespace quadrig
