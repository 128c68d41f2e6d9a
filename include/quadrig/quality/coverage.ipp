// Definitions of quality/coverage.hpp.
#pragma once

#include "quadrig/quality/coverage.hpp"

namespace quadrig {

QUADRIG_INLINE Coverage coverage(const TriangleMesh<double>& mesh, std::span<const Index> faces,
                                 const Points<double>& positions, const Quads& quads, double bound,
                                 const Context& context, std::span<double> of_vertex) {
  using detail::at;
  const Triangles halves = quad_halves(quads);
  const ClosestPoint tree(positions, halves);
  std::vector<Index> vertices;
  for (const Index f : faces)
    for (int i = 0; i < 3; ++i) vertices.push_back(mesh.faces()(f, i));
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());

  struct Part {
    double farthest = 0, beyond = 0;
    Vector3 place = Vector3::Zero();
    void see(double squared, const Vector3& p) {
      if (squared > farthest) farthest = squared, place = p;
    }
  };
  constexpr std::size_t run = 2048;
  const double squared_bound = bound * bound;
  std::vector<char> far(at(mesh.vertex_count()), 0);
  std::vector<Part> parts((vertices.size() + run - 1) / run + (faces.size() + run - 1) / run);
  const std::size_t vertex_parts = (vertices.size() + run - 1) / run;
  context.parallel_for(vertex_parts, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t part = begin; part < end && !context.cancelled(); ++part) {
      NearbyDistance distance(tree, positions, halves);
      for (std::size_t k = part * run; k < std::min(vertices.size(), (part + 1) * run); ++k) {
        const Vector3 p = mesh.position(vertices[k]);
        const double squared = distance(p).squared_distance;
        parts[part].see(squared, p);
        far[at(vertices[k])] = squared > squared_bound;
        if (!of_vertex.empty()) of_vertex[at(vertices[k])] = std::sqrt(squared);
      }
    }
  });
  context.parallel_for(parts.size() - vertex_parts, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t part = begin; part < end && !context.cancelled(); ++part) {
      NearbyDistance distance(tree, positions, halves);
      Part& own = parts[vertex_parts + part];
      for (std::size_t k = part * run; k < std::min(faces.size(), (part + 1) * run); ++k) {
        const Index f = faces[k];
        constexpr double a_square = 4;
        const auto count = static_cast<int>(a_square * mesh.area(f) / squared_bound);
        if (count == 0) {
          const auto corner = [&](int i) { return far[at(mesh.faces()(f, i))]; };
          if (corner(0) && corner(1) && corner(2)) own.beyond += mesh.area(f);
          continue;
        }
        SpreadPoints spread;
        for (int n = 0; n < count; ++n) {
          const Vector3 p = position(mesh, {f, spread.next()});
          const double squared = distance(p).squared_distance;
          own.see(squared, p);
          if (squared > squared_bound) own.beyond += mesh.area(f) / count;
        }
      }
    }
  });
  Part all;
  for (const Part& part : parts) {
    all.see(part.farthest, part.place);
    all.beyond += part.beyond;
  }
  double area = 0;
  for (const Index f : faces) area += mesh.area(f);
  return {std::sqrt(all.farthest), all.place, area > 0 ? all.beyond / area : 0};
}

QUADRIG_INLINE Stray stray(const TriangleMesh<double>& mesh, std::span<const Index> faces, const QuadMesh& quads,
                           Index first, Index count, double bound, const Context& context) {
  using detail::at;
  Stray result;
  std::optional<ClosestPoint> tree;
  const auto see = [&](const Vector3& p, const SurfacePoint& source) {
    double squared = walk_closest(mesh, p, source).squared_distance;
    if (squared > bound * bound) {
      if (!tree) {
        Triangles own(static_cast<Eigen::Index>(faces.size()), 3);
        for (std::size_t f = 0; f < faces.size(); ++f)
          own.row(static_cast<Eigen::Index>(f)) = mesh.faces().row(faces[f]);
        tree.emplace(mesh.positions(), own);
      }
      squared = std::min(squared, tree->closest(p).squared_distance);
    }
    if (squared > result.farthest * result.farthest) result = {std::sqrt(squared), p};
  };
  for (Index q = first; q < first + count; ++q) {
    if (q % 1024 == 0 && context.cancelled()) break;
    Vector3 centre = Vector3::Zero();
    for (int i = 0; i < 4; ++i) {
      const Vector3 p = quads.positions.row(quads.quads(q, i)).transpose();
      see(p, quads.source[at(quads.quads(q, i))]);
      centre += p / 4;
    }
    see(centre, quads.source[at(quads.quads(q, 0))]);
  }
  return result;
}

}  // namespace quadrig
