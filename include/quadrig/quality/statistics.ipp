// Definitions of quality/statistics.hpp.
#pragma once

#include <numbers>
#include <numeric>

#include "quadrig/quality/statistics.hpp"
#include "quadrig/quality/topology.hpp"

namespace quadrig {

QUADRIG_INLINE PolygonMesh to_polygons(const QuadMesh& mesh) {
  PolygonMesh result;
  result.positions = mesh.positions;
  result.corners.assign(mesh.quads.data(), mesh.quads.data() + mesh.quads.size());
  for (Index q = 0; q <= mesh.quad_count(); ++q) result.first_corner.push_back(4 * q);
  return result;
}

QUADRIG_INLINE PolygonMesh to_polygons(const TriangleMesh<double>& mesh) {
  PolygonMesh result;
  result.positions = mesh.positions();
  result.corners.assign(mesh.faces().data(), mesh.faces().data() + mesh.faces().size());
  for (Index f = 0; f <= mesh.face_count(); ++f) result.first_corner.push_back(3 * f);
  return result;
}

QUADRIG_INLINE MeshStatistics mesh_statistics(const PolygonMesh& mesh) {
  MeshStatistics s;
  s.faces = mesh.polygon_count();
  double sum = 0;
  Index negative = 0;
  s.scaled_jacobian_minimum = 1;
  std::vector<std::vector<Index>> sets(static_cast<std::size_t>(s.faces));
  for (Index f = 0; f < s.faces; ++f) {
    const auto polygon = mesh.polygon(f);
    if (polygon.size() == 3) ++s.triangles;
    if (polygon.size() > 4) ++s.ngons;
    auto& set = sets[static_cast<std::size_t>(f)];
    set.assign(polygon.begin(), polygon.end());
    std::sort(set.begin(), set.end());
    if (std::adjacent_find(set.begin(), set.end()) != set.end()) ++s.degenerate_faces;
    if (polygon.size() != 4) continue;
    ++s.quads;
    const double jacobian = scaled_jacobian(mesh.positions, {polygon[0], polygon[1], polygon[2], polygon[3]});
    sum += jacobian;
    s.scaled_jacobian_minimum = std::min(s.scaled_jacobian_minimum, jacobian);
    if (jacobian < 0) ++negative;
  }
  if (s.quads > 0) {
    s.scaled_jacobian_average = sum / s.quads;
    s.scaled_jacobian_negative = static_cast<double>(negative) / s.quads;
  } else {
    s.scaled_jacobian_minimum = 0;
  }
  std::sort(sets.begin(), sets.end());
  for (std::size_t f = 1; f < sets.size(); ++f)
    if (sets[f] == sets[f - 1]) ++s.duplicate_faces;

  const detail::PolygonTopology topology(mesh);
  s.vertices = topology.used_vertices;
  s.euler = topology.used_vertices - static_cast<Index>(topology.edges.size()) + s.faces;
  for (const auto& edge : topology.edges) {
    s.boundary_edges += edge.faces() == 1;
    s.nonmanifold_edges += edge.faces() > 2;
    s.misoriented_edges += edge.faces() == 2 && edge.forward != 1;
  }
  for (std::size_t v = 0; v < topology.valence.size(); ++v) {
    s.nonmanifold_vertices += topology.fans[v] > 1;
    if (topology.valence[v] == 0 || topology.on_nonmanifold[v]) continue;
    if (topology.on_boundary[v]) {
      s.irregular += topology.valence[v] != 3;
    } else if (topology.valence[v] != 4) {
      ++s.irregular;
      ++s.irregular_interior;
    }
  }
  s.components = static_cast<Index>(topology.components.size());
  for (const auto& component : topology.components) s.boundary_loops += component.boundary_loops;
  if (s.nonmanifold_edges == 0 && s.nonmanifold_vertices == 0 && s.misoriented_edges == 0)
    s.genus = (2 * s.components - s.euler - s.boundary_loops) / 2;
  return s;
}

QUADRIG_INLINE ShapeStatistics shape_statistics(const Points<double>& positions, const Quads& quads) {
  ShapeStatistics s;
  if (quads.rows() == 0) return s;
  const auto ratio = [](double a, double b) {
    const double low = std::min(a, b);
    return low > 0 ? std::max(a, b) / low : std::numeric_limits<double>::infinity();
  };
  std::vector<double> aspects, angles, areas;
  for (Eigen::Index q = 0; q < quads.rows(); ++q) {
    Vector3 p[4];
    for (int i = 0; i < 4; ++i) p[i] = positions.row(quads(q, i)).transpose();
    aspects.push_back(ratio((p[1] + p[2] - p[0] - p[3]).norm(), (p[2] + p[3] - p[0] - p[1]).norm()));
    areas.push_back((p[2] - p[0]).cross(p[3] - p[1]).norm() / 2);
    double shortest = std::numeric_limits<double>::infinity(), longest = 0;
    for (int i = 0; i < 4; ++i) {
      const Vector3 next = p[(i + 1) % 4] - p[i], previous = p[(i + 3) % 4] - p[i];
      shortest = std::min(shortest, next.norm());
      longest = std::max(longest, next.norm());
      const double angle = elementary::atan2(next.cross(previous).norm(), next.dot(previous));
      angles.push_back(std::abs(angle * 180 / std::numbers::pi - 90));
    }
    s.edge_ratio_mean += ratio(longest, shortest);
  }
  const auto mean = [](const std::vector<double>& x) {
    return std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
  };
  s.edge_ratio_mean /= static_cast<double>(quads.rows());
  s.aspect_mean = mean(aspects);
  s.aspect_maximum = *std::max_element(aspects.begin(), aspects.end());
  s.angle_error_mean_degrees = mean(angles);
  s.angle_error_maximum_degrees = *std::max_element(angles.begin(), angles.end());
  s.angle_error_p99_degrees = quantile(std::move(angles), 0.99);
  s.aspect_p99 = quantile(std::move(aspects), 0.99);
  const double small = quantile(areas, 0.01), large = quantile(std::move(areas), 0.99);
  s.area_p99_by_p1 = ratio(large, small);
  return s;
}

}  // namespace quadrig
