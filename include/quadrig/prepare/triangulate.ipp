// Polygons to triangles.
#pragma once

#include "quadrig/prepare.hpp"

namespace quadrig {
namespace prepare_detail {

/// Twice the area vector (Newell's normal) of a polygon.
inline Vector3 newell_normal(const Points<double>& positions, std::span<const Index> polygon) {
  Vector3 sum = Vector3::Zero();
  const Vector3 origin = positions.row(polygon[0]).transpose();
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    const Vector3 a = positions.row(polygon[i]).transpose() - origin;
    const Vector3 b = positions.row(polygon[i + 1]).transpose() - origin;
    sum += a.cross(b);
  }
  return sum;
}

inline Vector3 triangle_normal(const Points<double>& positions, Index a, Index b, Index c) {
  const Vector3 pa = positions.row(a).transpose();
  return (positions.row(b).transpose() - pa).cross(positions.row(c).transpose() - pa);
}

/// 0 or 1: cut the quad from that corner. A diagonal is sound where both halves turn as the quad does.
inline int quad_diagonal(const Points<double>& positions, std::span<const Index> q) {
  const Vector3 normal = newell_normal(positions, q);
  double least[2], length[2];
  for (std::size_t d = 0; d < 2; ++d) {
    const Vector3 first = triangle_normal(positions, q[d], q[d + 1], q[d + 2]);
    const Vector3 second = triangle_normal(positions, q[d], q[d + 2], q[(d + 3) % 4]);
    least[d] = std::min(first.dot(normal), second.dot(normal));
    length[d] = (positions.row(q[d]) - positions.row(q[d + 2])).squaredNorm();
  }
  if (least[0] > 0 && least[1] > 0) return length[1] < length[0] ? 1 : 0;
  return least[1] > least[0] ? 1 : 0;
}

/// Ear clipping in the plane of the normal; always makes size − 2 triangles, the best left when no ear is sound.
inline void clip_ears(const Points<double>& positions, std::span<const Index> polygon,
                      function_ref<void(Index, Index, Index)> emit) {
  Vector3 normal = newell_normal(positions, polygon);
  if (!(normal.norm() > 0)) normal = Vector3::UnitZ();
  normal.normalize();
  const Vector3 x_axis = normal.unitOrthogonal(), y_axis = normal.cross(x_axis);
  using Point = Eigen::Vector2d;
  const auto cross = [](const Point& a, const Point& b, const Point& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
  };
  std::vector<Point> flat(polygon.size());
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3 p = (positions.row(polygon[i]) - positions.row(polygon[0])).transpose();
    flat[i] = Point(p.dot(x_axis), p.dot(y_axis));
  }
  std::vector<std::size_t> ring(polygon.size());
  for (std::size_t i = 0; i < ring.size(); ++i) ring[i] = i;
  while (ring.size() > 3) {
    const std::size_t n = ring.size();
    std::size_t best = 0;
    double best_score = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const Point &a = flat[ring[(i + n - 1) % n]], &b = flat[ring[i]], &c = flat[ring[(i + 1) % n]];
      const double area = cross(a, b, c);
      const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
      double score = longest > 0 ? area / longest : 0;  // grows with the least angle; negative at reflex corners
      if (score > 0 && score > best_score) {
        for (std::size_t j = 0; j < n; ++j) {
          const Point& p = flat[ring[j]];
          if (p == a || p == b || p == c) continue;
          if (cross(a, b, p) >= 0 && cross(b, c, p) >= 0 && cross(c, a, p) >= 0) {
            score = -longest;  // another corner lies in the ear: only when nothing else is left
            break;
          }
        }
      }
      if (score > best_score) best = i, best_score = score;
    }
    emit(polygon[ring[(best + n - 1) % n]], polygon[ring[best]], polygon[ring[(best + 1) % n]]);
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(best));
  }
  emit(polygon[ring[0]], polygon[ring[1]], polygon[ring[2]]);
}

}  // namespace prepare_detail

QUADRIG_INLINE PolygonMesh PolygonMesh::from_triangles(Points<double> positions, const Triangles& faces) {
  PolygonMesh result;
  result.positions = std::move(positions);
  result.corners.assign(faces.data(), faces.data() + faces.size());
  result.first_corner.resize(static_cast<std::size_t>(faces.rows()) + 1);
  for (std::size_t i = 0; i < result.first_corner.size(); ++i) result.first_corner[i] = static_cast<Index>(3 * i);
  return result;
}

QUADRIG_INLINE Expected<Triangulation> triangulate(const PolygonMesh& polygons, Index max_corners) {
  constexpr std::size_t face_limit = std::size_t{1} << 31;
  const Points<double>& positions = polygons.positions;
  constexpr double largest = 1e60;  // products of a few lengths are to be finite
  for (Index v = 0; v < polygons.vertex_count(); ++v)
    if (!positions.row(v).allFinite() || !(positions.row(v).cwiseAbs().maxCoeff() < largest))
      return Error{ErrorCode::bad_input,
                   positions.row(v).allFinite() ? "position is beyond 1e60" : "position is not finite",
                   "vertex " + std::to_string(v), "give every vertex three finite coordinates"};
  std::size_t triangles = 0;
  for (Index i = 0; i < polygons.polygon_count(); ++i) {
    const std::span<const Index> polygon = polygons.polygon(i);
    for (const Index v : polygon)
      if (v < 0 || v >= polygons.vertex_count())
        return Error{ErrorCode::bad_input,
                     "vertex index " + std::to_string(v) + " is out of range [0, " +
                         std::to_string(polygons.vertex_count()) + ")",
                     "face " + std::to_string(i), "name only vertices that exist"};
    if (polygon.size() > static_cast<std::size_t>(max_corners))
      return Error{
          ErrorCode::bad_input,
          "a polygon of " + std::to_string(polygon.size()) + " corners, more than " + std::to_string(max_corners),
          "face " + std::to_string(i), "triangulate it before"};
    triangles += polygon.size() < 3 ? 0 : polygon.size() - 2;
  }
  if (3 * triangles >= face_limit)
    return Error{
        ErrorCode::unsupported, std::to_string(triangles) + " triangles, more than 2^31 / 3", {}, "use a smaller mesh"};

  Triangulation result;
  std::vector<Index> flat;
  flat.reserve(3 * triangles);
  result.polygon.reserve(triangles);
  std::vector<Index> ring;
  for (Index i = 0; i < polygons.polygon_count(); ++i) {
    const auto emit = [&](Index a, Index b, Index c) {
      flat.insert(flat.end(), {a, b, c});
      result.polygon.push_back(i);
    };
    ring.clear();
    for (const Index v : polygons.polygon(i))
      if (ring.empty() || ring.back() != v) ring.push_back(v);
    while (ring.size() > 1 && ring.front() == ring.back()) ring.pop_back();
    if (ring.size() < 3) {
      ++result.degenerate_polygons;
    } else if (ring.size() == 3) {
      emit(ring[0], ring[1], ring[2]);
    } else if (ring.size() == 4) {
      const auto d = static_cast<std::size_t>(prepare_detail::quad_diagonal(positions, ring));
      emit(ring[d], ring[d + 1], ring[d + 2]);
      emit(ring[d], ring[d + 2], ring[(d + 3) % 4]);
    } else {
      prepare_detail::clip_ears(positions, ring, emit);
    }
  }
  result.faces = Eigen::Map<const Triangles>(flat.data(), static_cast<Eigen::Index>(flat.size() / 3), 3);
  return result;
}

}  // namespace quadrig
