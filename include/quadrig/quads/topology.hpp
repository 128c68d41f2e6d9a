// What the topology of a quad mesh has to be.
#pragma once

#include "quadrig/field/matching.hpp"
#include "quadrig/quads.hpp"

namespace quadrig {

/// Counts of a connected or unconnected quad mesh, and the first thing that keeps it from being an oriented manifold.
struct QuadTopology {
  Index euler = 0, boundary_loops = 0;
  Index irregular = 0;            ///< inner vertices whose valence is not 4
  std::string defect;             ///< empty for an oriented manifold without repeated vertices or quads
  std::vector<Index> at_defects;  ///< vertices of that and of others like it, as often as they are met
};

/// \cost O(m log m).
[[nodiscard]] inline QuadTopology quad_topology(const Quads& quads, Index vertex_count) {
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  QuadTopology result;
  const Index m = static_cast<Index>(quads.rows());
  const auto fail = [&](std::string text, std::initializer_list<Index> vertices) {
    if (result.defect.empty()) result.defect = std::move(text);
    result.at_defects.insert(result.at_defects.end(), vertices);
  };
  struct Side {
    Index low, high, corner;
    bool forward;
  };
  std::vector<Side> sides;
  sides.reserve(at(4 * m));
  std::vector<Index> corners(at(vertex_count), 0), valence(at(vertex_count), 0);
  for (Index q = 0; q < m; ++q)
    for (int i = 0; i < 4; ++i) {
      const Index a = quads(q, i), b = quads(q, (i + 1) % 4);
      if (a == b || a == quads(q, (i + 2) % 4)) fail("quad " + std::to_string(q) + " repeats a vertex", {a});
      sides.push_back({std::min(a, b), std::max(a, b), 4 * q + i, a < b});
      ++corners[at(a)];
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::array{a.low, a.high, a.corner} < std::array{b.low, b.high, b.corner};
  });
  std::vector<Index> twin(at(4 * m), no_index), next_border(at(vertex_count), no_index);
  Index edges = 0;
  for (std::size_t k = 0, last = 0; k < sides.size(); k = last) {
    while (last < sides.size() && sides[last].low == sides[k].low && sides[last].high == sides[k].high) ++last;
    ++edges;
    ++valence[at(sides[k].low)];
    ++valence[at(sides[k].high)];
    const std::string place = std::to_string(sides[k].low) + " - " + std::to_string(sides[k].high);
    if (last - k > 2)
      fail("edge " + place + " has " + std::to_string(last - k) + " quads", {sides[k].low, sides[k].high});
    if (last - k == 2) {
      if (sides[k].forward == sides[k + 1].forward)
        fail("edge " + place + " is run the same way twice", {sides[k].low, sides[k].high});
      twin[at(sides[k].corner)] = sides[k + 1].corner;
      twin[at(sides[k + 1].corner)] = sides[k].corner;
    }
    if (last - k == 1) {
      const Index from = sides[k].forward ? sides[k].low : sides[k].high;
      if (next_border[at(from)] != no_index) fail("vertex " + std::to_string(from) + " joins two borders", {from});
      next_border[at(from)] = sides[k].forward ? sides[k].high : sides[k].low;
    }
  }
  Index used = 0;
  for (Index v = 0; v < vertex_count; ++v) {
    if (corners[at(v)] == 0) {
      fail("vertex " + std::to_string(v) + " belongs to no quad", {v});
      continue;
    }
    ++used;
    if (next_border[at(v)] == no_index && valence[at(v)] != 4) ++result.irregular;
  }
  if (result.defect.empty()) {
    // Turning around a corner through twins must meet every quad of its vertex.
    std::vector<char> seen(at(4 * m), 0), met(at(vertex_count), 0);
    for (Index c = 0; c < 4 * m; ++c) {
      const Index v = quads(c / 4, c % 4);
      if (met[at(v)]) continue;
      met[at(v)] = 1;
      // Counter-clockwise by the side that ends at v, then clockwise from the start by the one that leaves it.
      Index count = 0;
      const auto clockwise = [&](Index k) {
        const Index across = twin[at(k)];
        return across == no_index ? no_index : across - across % 4 + (across % 4 + 1) % 4;
      };
      for (Index k = c; k != no_index && !seen[at(k)]; k = twin[at(k - k % 4 + (k % 4 + 3) % 4)]) {
        seen[at(k)] = 1;
        ++count;
      }
      for (Index k = clockwise(c); k != no_index && !seen[at(k)]; k = clockwise(k)) {
        seen[at(k)] = 1;
        ++count;
      }
      if (count != corners[at(v)]) fail("the quads at vertex " + std::to_string(v) + " form more than one fan", {v});
    }
    std::vector<std::array<Index, 4>> sorted(at(m));
    for (Index q = 0; q < m; ++q) {
      sorted[at(q)] = {quads(q, 0), quads(q, 1), quads(q, 2), quads(q, 3)};
      std::sort(sorted[at(q)].begin(), sorted[at(q)].end());
    }
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t k = 1; k < sorted.size(); ++k)
      if (sorted[k - 1] == sorted[k])
        fail("two quads have the same vertices", {sorted[k][0], sorted[k][1], sorted[k][2], sorted[k][3]});
    std::vector<char> walked(at(vertex_count), 0);
    for (Index v = 0; v < vertex_count; ++v) {
      if (next_border[at(v)] == no_index || walked[at(v)]) continue;
      ++result.boundary_loops;
      for (Index w = v; w != no_index && !walked[at(w)]; w = next_border[at(w)]) walked[at(w)] = 1;
    }
  }
  result.euler = used - edges + m;
  return result;
}

/// Euler characteristic and border loops of a surface, which its quads have to have too. \cost O(m)
struct SurfaceTopology {
  explicit SurfaceTopology(const TriangleMesh<double>& mesh) : euler(euler_characteristic(mesh)) {
    std::vector<char> seen(detail::at(mesh.vertex_count()), 0);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      if (seen[detail::at(v)] || !mesh.on_boundary(v)) continue;
      ++loops;
      for (Index w = v; !seen[detail::at(w)]; w = mesh.target(mesh.outgoing(w))) seen[detail::at(w)] = 1;
    }
  }
  Index euler, loops = 0;
};

/// Why the quads are not a mesh like the surface; empty where they are.
[[nodiscard]] inline std::string unlike(const QuadTopology& quads, const SurfaceTopology& surface) {
  if (!quads.defect.empty()) return quads.defect;
  if (quads.euler != surface.euler || quads.boundary_loops != surface.loops)
    return "the quads have another topology than the surface";
  return {};
}

}  // namespace quadrig
