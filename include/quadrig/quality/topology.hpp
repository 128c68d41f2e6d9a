// Edges, fans and components of arbitrary polygons: shared by statistics and the validity check.
#pragma once

#include "quadrig/disjoint_sets.hpp"
#include "quadrig/prepare.hpp"

namespace quadrig::detail {

struct PolygonTopology {
  /// An undirected edge and the corners whose polygon runs along it, corner to next corner, ascending.
  struct Edge {
    Index low, high;
    std::size_t first, last;  // in `sides`
    Index forward = 0;        // sides that run from low to high
    [[nodiscard]] Index faces() const { return static_cast<Index>(last - first); }
  };
  struct Component {
    Index vertices = 0, edges = 0, faces = 0, boundary_loops = 0;
    Index first_face = no_index;
    /// \pre an oriented manifold
    [[nodiscard]] Index genus() const { return (2 - (vertices - edges + faces) - boundary_loops) / 2; }
  };

  std::vector<Edge> edges;
  std::vector<std::size_t> sides;  // corners, grouped by edge
  std::vector<Index> face_of_corner;
  std::vector<Index> valence, fans;  // by vertex; 0 where no face uses it
  std::vector<char> on_boundary, on_nonmanifold;
  std::vector<Index> component_of;    // by vertex; no_index where no face uses it
  std::vector<Component> components;  // by lowest vertex
  Index used_vertices = 0;

  explicit PolygonTopology(const PolygonMesh& mesh)
      : face_of_corner(mesh.corners.size()),
        valence(static_cast<std::size_t>(mesh.vertex_count()), 0),
        fans(valence),
        on_boundary(valence.size(), 0),
        on_nonmanifold(valence.size(), 0),
        component_of(valence.size(), no_index) {
    const std::size_t corner_count = mesh.corners.size();
    std::vector<std::size_t> next(corner_count);
    for (Index f = 0; f < mesh.polygon_count(); ++f) {
      const auto first = static_cast<std::size_t>(mesh.first_corner[static_cast<std::size_t>(f)]);
      const auto last = static_cast<std::size_t>(mesh.first_corner[static_cast<std::size_t>(f) + 1]);
      for (std::size_t c = first; c < last; ++c) {
        next[c] = c + 1 < last ? c + 1 : first;
        face_of_corner[c] = f;
      }
    }
    const auto vertex = [&](std::size_t corner) { return static_cast<std::size_t>(mesh.corners[corner]); };
    const auto ends = [&](Index c) { return SortedSide::of(mesh.corners[at(c)], mesh.corners[next[at(c)]], c); };
    // Corners of a vertex belong to one fan when an edge at that vertex joins them.
    DisjointSets fan(corner_count), shell(valence.size()), border(valence.size());
    sides.reserve(corner_count);
    const auto sorted = sorted_by_edge(mesh.vertex_count(), static_cast<Index>(corner_count), ends);
    for_each_edge(sorted, [&](std::span<const SortedSide> of_edge) {
      Edge edge{of_edge[0].low, of_edge[0].high, sides.size(), sides.size() + of_edge.size(), 0};
      for (const SortedSide& side : of_edge) {
        sides.push_back(at(side.halfedge));
        edge.forward += mesh.corners[sides.back()] < mesh.corners[next[sides.back()]];
      }
      for (std::size_t k = edge.first + 1; k < edge.last; ++k)
        for (const Index v : {edge.low, edge.high}) {
          const auto corner = [&](std::size_t side) { return mesh.corners[side] == v ? side : next[side]; };
          fan.join(corner(sides[k - 1]), corner(sides[k]));
        }
      const auto a = at(edge.low), b = at(edge.high);
      ++valence[a];
      ++valence[b];
      shell.join(a, b);
      if (edge.faces() == 1) {
        on_boundary[a] = on_boundary[b] = 1;
        border.join(a, b);
      }
      if (edge.faces() > 2) on_nonmanifold[a] = on_nonmanifold[b] = 1;
      edges.push_back(edge);
    });
    for (std::size_t c = 0; c < corner_count; ++c)
      if (fan.find(c) == c) ++fans[vertex(c)];
    for (std::size_t v = 0; v < valence.size(); ++v) {
      if (valence[v] == 0) continue;
      ++used_vertices;
      const std::size_t root = shell.find(v);
      if (root == v) {
        component_of[v] = static_cast<Index>(components.size());
        components.emplace_back();
      }
      component_of[v] = component_of[root];
      Component& own = components[static_cast<std::size_t>(component_of[v])];
      ++own.vertices;
      if (on_boundary[v] && border.find(v) == v) ++own.boundary_loops;
    }
    for (const Edge& edge : edges)
      ++components[static_cast<std::size_t>(component_of[static_cast<std::size_t>(edge.low)])].edges;
    for (Index f = 0; f < mesh.polygon_count(); ++f) {
      const auto polygon = mesh.polygon(f);
      if (polygon.empty()) continue;
      Component& own = components[static_cast<std::size_t>(component_of[static_cast<std::size_t>(polygon[0])])];
      ++own.faces;
      if (own.first_face == no_index) own.first_face = f;
    }
  }
};

}  // namespace quadrig::detail
