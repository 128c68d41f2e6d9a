// Edges that quads must keep: creases, the caller's edges, and borders of vertex groups.
#pragma once

#include "quadrig/constraints/features.hpp"
#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/piece.hpp"

namespace quadrig::detail {

/// Creases and the caller's edges as marks of the asset's mesh; empty where there are none.
[[nodiscard]] inline EdgeMarks kept_edges(const TriangleMesh<double>& mesh, const RemeshOptions& options) {
  std::vector<Index> halfedges = options.features;
  if (options.crease_angle_radians < std::numbers::pi) {
    // A noisy scan bends sharply at many single edges; a crease runs on.
    const Components components = face_components(mesh);
    std::vector<double> area(at(components.count), 0.0);
    for (Index f = 0; f < mesh.face_count(); ++f) area[at(components.of_face[at(f)])] += mesh.area(f);
    const auto least = [&](Index f) { return 0.5 * std::sqrt(area[at(components.of_face[at(f)])]); };
    const std::vector<Index> creases =
        crease_halfedges(mesh, options.crease_angle_radians, function_ref<double(Index)>(least));
    halfedges.insert(halfedges.end(), creases.begin(), creases.end());
  }
  EdgeMarks marks;
  for (const Index h : halfedges) {
    if (mesh.twin(h) == no_index) continue;  // the border is kept without being asked
    marks.resize(at(mesh.halfedge_count()), 0);
    marks[at(h)] = marks[at(mesh.twin(h))] = 1;
  }
  return marks;
}

/// Those of a piece's faces.
[[nodiscard]] inline EdgeMarks marks_of(const EdgeMarks& marks, std::span<const Index> faces) {
  if (marks.empty()) return {};
  EdgeMarks result;
  bool any = false;
  for (const Index f : faces)
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      result.push_back(marks[at(h)]);
      any = any || marks[at(h)];
    }
  return any ? result : EdgeMarks{};
}

/// Unmarks connected sets of edges whose total length is below the limit.
inline void drop_short(const TriangleMesh<double>& mesh, double least_length, EdgeMarks& marks) {
  std::vector<double> length(at(mesh.vertex_count()), -1);
  std::vector<Index> open;
  for (Index seed = 0; seed < mesh.halfedge_count(); ++seed) {
    if (!marks[at(seed)] || length[at(mesh.origin(seed))] >= 0) continue;
    double sum = 0;
    open.assign(1, mesh.origin(seed));
    length[at(open[0])] = 0;
    for (std::size_t k = 0; k < open.size(); ++k) {
      Index h = mesh.outgoing(open[k]);
      const Index start = h;
      do {
        // The incoming edge at the end of a fan is visited from its other end.
        if (marks[at(h)]) {
          sum += mesh.edge_vector(h).norm() / 2;
          if (const Index w = mesh.target(h); length[at(w)] < 0) {
            length[at(w)] = 0;
            open.push_back(w);
          }
        }
        h = mesh.next_around(h);
      } while (h != no_index && h != start);
    }
    for (const Index v : open) length[at(v)] = sum;
  }
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (marks[at(h)] && length[at(mesh.origin(h))] < least_length) marks[at(h)] = 0;
}

/// Cuts the piece where the vertex group of largest weight changes and marks the cuts, except around islands whose
/// border is shorter than `least_length`. \pre it has a rig
inline void keep_group_borders(Piece& piece, double least_length) {
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  const SkinWeights& weights = piece.asset.rig->weights;
  std::vector<Index> group(at(mesh.vertex_count()), 0);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    double most = 0;
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      if (it.value() > most) {
        most = it.value();
        group[at(v)] = static_cast<Index>(it.col());
      }
  }
  std::vector<char> cut(at(mesh.halfedge_count()), 0);
  bool any = false;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (group[at(mesh.origin(h))] != group[at(mesh.target(h))]) cut[at(h)] = 1, any = true;
  if (!any) return;
  const auto share = [&](Index h) {
    const Index v = mesh.origin(h), w = mesh.target(h), a = group[at(v)], b = group[at(w)];
    const double here = weights.coeff(v, a) - weights.coeff(v, b), there = weights.coeff(w, b) - weights.coeff(w, a);
    return here + there > 0 ? std::clamp(here / (here + there), 0.05, 0.95) : 0.5;  // no slivers
  };
  Refinement finer = split_edges(mesh, cut, share);
  EdgeMarks kept = carried_marks(mesh, piece.kept, finer), borders(at(finer.mesh.halfedge_count()), 0);
  const Index old = mesh.vertex_count();
  for (Index g = 0; g < finer.mesh.halfedge_count(); ++g) {
    const Index a = finer.mesh.origin(g), b = finer.mesh.target(g);
    if (a < old || b < old) continue;
    // Where three groups meet, the borders do at one of the cuts, that which is lowest: the edge across is none.
    const Index across = finer.mesh.twin(g), third = finer.mesh.target(finer.mesh.next(g)),
                other = across == no_index ? no_index : finer.mesh.target(finer.mesh.next(across));
    if ((third >= old && third < std::min(a, b)) || (other >= old && other < std::min(a, b))) continue;
    borders[at(g)] = 1;
  }
  drop_short(finer.mesh, least_length, borders);
  replace_mesh(piece, std::move(finer));
  piece.kept = joined_marks(std::move(borders), kept);
}

/// How much of the kept edges became edges of quads.
struct Kept {
  std::vector<char> vertex;  ///< of the quads: lies on one
  double as_quads = 0;       ///< length of those that edges of quads run along
};
[[nodiscard]] inline Kept measure_kept(const TriangleMesh<double>& mesh, const EdgeMarks& marks,
                                       const QuadMesh& quads) {
  Kept result;
  if (marks.empty()) return result;
  constexpr double near = 1e-6;
  const EdgeCurves curves(mesh, marks);
  for (Index v = 0; v < quads.vertex_count(); ++v)
    result.vertex.push_back(curves.under(quads.source[at(v)], near) != no_index);
  for (Index q = 0; q < quads.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Index v = quads.quads(q, i), w = quads.quads(q, (i + 1) % 4);
      if (!result.vertex[at(v)] || !result.vertex[at(w)]) continue;
      const double straight = (quads.positions.row(v) - quads.positions.row(w)).norm();
      if (const auto along = curves.distance(quads.source[at(v)], quads.source[at(w)], near);
          along && *along < 1.5 * straight)
        result.as_quads += *along / 2;  // both its quads count it
    }
  return result;
}

}  // namespace quadrig::detail
