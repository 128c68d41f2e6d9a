// A component of an asset by itself, on triangles that a map can be made on.
#pragma once

#include "quadrig/asset.hpp"
#include "quadrig/pipeline/stand_in.hpp"
#include "quadrig/prepare/split_edges.hpp"
#include "quadrig/seamless/cut_graph.hpp"

namespace quadrig::detail {

/// A component as an asset of its own, refined where the map needs it; `parent` is the asset's face of each face.
struct Piece {
  Asset asset;
  std::vector<Index> parent;
  /// Of a piece that stands for another: each vertex on the surface of that one.
  std::vector<SurfacePoint> source;
  /// Edges that must become edges of quads, or empty: none.
  EdgeMarks kept;
  /// Of a half of a component: border edges that lie on the mirror plane.
  EdgeMarks mirror{};
};

/// Some faces of a mesh with their vertices, numbered anew in the order in which they come.
struct FacePatch {
  Triangles triangles;
  Points<double> positions;
  std::vector<Index> vertices;  ///< of the mesh, of each vertex
};

/// Nothing once cancelled. \cost O(faces + vertices of the mesh)
inline std::optional<FacePatch> face_patch(const TriangleMesh<double>& mesh, std::span<const Index> faces,
                                           const Context& context) {
  std::vector<Index> number(at(mesh.vertex_count()), no_index);
  FacePatch patch;
  patch.triangles.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (f % 4096 == 0 && context.cancelled()) return std::nullopt;
    for (int i = 0; i < 3; ++i) {
      const Index v = mesh.faces()(faces[f], i);
      if (number[at(v)] == no_index) {
        number[at(v)] = static_cast<Index>(patch.vertices.size());
        patch.vertices.push_back(v);
      }
      patch.triangles(static_cast<Eigen::Index>(f), i) = number[at(v)];
    }
  }
  patch.positions.resize(static_cast<Eigen::Index>(patch.vertices.size()), 3);
  for (std::size_t v = 0; v < patch.vertices.size(); ++v)
    patch.positions.row(static_cast<Eigen::Index>(v)) = mesh.positions().row(patch.vertices[v]);
  return patch;
}

/// Incomplete once cancelled.
inline Piece make_piece(const Asset& asset, std::span<const Index> faces, const Context& context = {}) {
  Piece piece;
  std::optional<FacePatch> patch = face_patch(asset.mesh, faces, context);
  if (!patch) return piece;
  const std::vector<Index>& vertices = patch->vertices;
  if (context.cancelled()) return piece;
  Expected<TriangleMesh<double>> mesh =
      TriangleMesh<double>::create(std::move(patch->positions), std::move(patch->triangles));
  assert(mesh);
  piece.asset.mesh = std::move(*mesh);
  if (context.cancelled()) return piece;
  piece.parent.assign(faces.begin(), faces.end());
  if (asset.rig) {
    piece.asset.rig =
        Rig{asset.rig->skeleton, SkinWeights(static_cast<Index>(vertices.size()), asset.rig->weights.cols()), {}};
    std::vector<Eigen::Triplet<double, Index>> entries;
    for (std::size_t v = 0; v < vertices.size(); ++v)
      for (SkinWeights::InnerIterator it(asset.rig->weights, vertices[v]); it; ++it)
        entries.emplace_back(static_cast<Index>(v), static_cast<Index>(it.col()), it.value());
    piece.asset.rig->weights.setFromTriplets(entries.begin(), entries.end());
  }
  return piece;
}

inline void replace_mesh(Piece& piece, Refinement&& finer) {
  if (piece.asset.rig) piece.asset.rig->weights = interpolate(piece.asset.mesh, piece.asset.rig->weights, finer.source);
  piece.kept = carried_marks(piece.asset.mesh, piece.kept, finer);
  piece.mirror = carried_marks(piece.asset.mesh, piece.mirror, finer);
  for (Index& f : finer.source_face) f = piece.parent[at(f)];
  piece.parent = std::move(finer.source_face);
  piece.asset.mesh = std::move(finer.mesh);
}

/// The mesh cut so that no edge joins two vertices of the border, or of what is kept, but those edges themselves: a map
/// would have to flatten a triangle there. Nothing where it has none.
[[nodiscard]] inline std::optional<Refinement> border_freed(const TriangleMesh<double>& mesh, const EdgeMarks& kept) {
  if (mesh.closed() && kept.empty()) return std::nullopt;
  const EdgeMarks lines = joined_marks(border_marks(mesh), kept);
  std::vector<char> on_line(at(mesh.vertex_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (lines[at(h)]) on_line[at(mesh.origin(h))] = on_line[at(mesh.target(h))] = 1;
  std::vector<char> marked(at(mesh.halfedge_count()), 0);
  bool any = false;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (!lines[at(h)] && on_line[at(mesh.origin(h))] && on_line[at(mesh.target(h))]) marked[at(h)] = 1, any = true;
  // A triangle all of lines has no edge inside: cut all three, and the inner face keeps them apart.
  for (Index f = 0; f < mesh.face_count(); ++f)
    if (lines[at(3 * f)] && lines[at(3 * f + 1)] && lines[at(3 * f + 2)])
      marked[at(3 * f)] = marked[at(3 * f + 1)] = marked[at(3 * f + 2)] = 1, any = true;
  if (!any) return std::nullopt;
  return split_edges(mesh, marked);
}

/// Edge lengths at most `target`. \fails unsupported where that takes more than `most` faces and four times those it
/// has
inline Status refine_piece(Piece& piece, double target, Index most, Context& context) {
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  bool needed = false;
  for (Index h = 0; h < mesh.halfedge_count() && !needed; ++h) needed = mesh.edge_vector(h).norm() > target;
  if (!needed) return {};
  const auto length = [&](Index) { return target; };
  RefineOptions options;
  options.max_faces = std::max<Index>(4 * mesh.face_count(), most);
  Expected<Refinement> finer = refine(mesh, length, options, context);
  if (!finer) return finer.error();
  replace_mesh(piece, std::move(*finer));
  return {};
}

/// The border edges of a stand-in whose ends lie on marked border edges of the surface. \param source of each vertex
[[nodiscard]] inline EdgeMarks border_marks_of(const TriangleMesh<double>& mesh, std::span<const SurfacePoint> source,
                                               const TriangleMesh<double>& surface, const EdgeMarks& marked) {
  constexpr double off = 1e-9;
  const EdgeCurves curves(surface, marked);
  const auto lies_on = [&](Index v) { return curves.under(source[at(v)], off) != no_index; };
  EdgeMarks marks(at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    marks[at(h)] = mesh.twin(h) == no_index && lies_on(mesh.origin(h)) && lies_on(mesh.target(h));
  return marks;
}

/// The piece on a stand-in of about `faces` faces. \fails as make_stand_in
[[nodiscard]] inline Expected<Piece> stand_in_piece(const Piece& original, Index faces, Context& context) {
  const TriangleMesh<double>& surface = original.asset.mesh;
  Expected<StandIn> made = make_stand_in(surface, original.kept, faces, context);
  if (!made) return made.error();
  while (std::optional<Refinement> freed = border_freed(made->mesh, made->kept)) {
    const OntoSurface onto(made->mesh, made->source, made->kept, surface, original.kept);
    std::vector<SurfacePoint> source;
    for (const SurfacePoint& point : freed->source) source.push_back(onto(point));
    EdgeMarks kept = carried_marks(made->mesh, made->kept, *freed);
    *made = {std::move(freed->mesh), std::move(source), std::move(kept)};
  }
  Piece piece{{std::move(made->mesh), std::nullopt}, {}, std::move(made->source), std::move(made->kept)};
  if (!original.mirror.empty())
    piece.mirror = border_marks_of(piece.asset.mesh, piece.source, surface, original.mirror);
  const OntoSurface onto(piece.asset.mesh, piece.source, piece.kept, surface, original.kept);
  for (Index f = 0; f < piece.asset.mesh.face_count(); ++f) {
    if (f % 1024 == 0 && context.cancelled()) return cancelled_error("stand-in");
    piece.parent.push_back(original.parent[at(onto({f, Vector3::Constant(1.0 / 3)}).face)]);
  }
  if (original.asset.rig)
    piece.asset.rig =
        Rig{original.asset.rig->skeleton, interpolate(surface, original.asset.rig->weights, piece.source), {}};
  return piece;
}

}  // namespace quadrig::detail
