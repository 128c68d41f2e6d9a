// A coarser, even triangulation of a surface, for surfaces whose own triangles are too thin or far too many for a map.
#pragma once

#include <memory>

#include "quadrig/closest.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/simplify/decimate.hpp"
#include "quadrig/simplify/refined.hpp"

namespace quadrig::detail {

/// Round triangles of about one size; every vertex lies on the surface that they stand for.
struct StandIn {
  TriangleMesh<double> mesh;
  std::vector<SurfacePoint> source;  ///< of each vertex, on the surface
  EdgeMarks kept;                    ///< where the surface has such
};

/// The marks of a mesh on a refinement of it.
[[nodiscard]] inline EdgeMarks carried_marks(const TriangleMesh<double>& mesh, const EdgeMarks& marks,
                                             const Refinement& finer) {
  if (marks.empty()) return {};
  // The edge that each vertex lies on, by its lower half-edge; of the vertices of the mesh none.
  std::vector<Index> edge(finer.source.size(), no_index);
  for (std::size_t v = at(mesh.vertex_count()); v < edge.size(); ++v)
    for (int i = 0; i < 3; ++i)
      if (finer.source[v].barycentric[(i + 2) % 3] == 0) {
        const Index h = 3 * finer.source[v].face + i, g = mesh.twin(h);
        edge[v] = g == no_index ? h : std::min(h, g);
      }
  EdgeMarks result(at(finer.mesh.halfedge_count()), 0);
  for (Index g = 0; g < finer.mesh.halfedge_count(); ++g) {
    const Index a = finer.mesh.origin(g), b = finer.mesh.target(g);
    const Index face = finer.source_face[at(g / 3)];
    for (Index h = 3 * face; h < 3 * face + 3; ++h) {
      if (!marks[at(h)]) continue;
      const Index across = mesh.twin(h), low = across == no_index ? h : std::min(h, across);
      const auto on = [&](Index v) {
        return v < mesh.vertex_count() ? v == mesh.origin(h) || v == mesh.target(h) : edge[at(v)] == low;
      };
      if (on(a) && on(b)) result[at(g)] = 1;
    }
  }
  return result;
}

/// A stand-in of about `faces` faces with the topology and the border loops of the surface.
/// \pre mesh has a face, and none of zero area
/// \fails cancelled; numeric where what is left is no manifold
/// \cost as split_quads
[[nodiscard]] inline Expected<StandIn> make_stand_in(const TriangleMesh<double>& mesh, const EdgeMarks& kept,
                                                     Index faces, Context& context) {
  Expected<std::optional<Refinement>> refined = refined_to_choose(mesh, faces, RefineOptions{}, context);
  if (!refined) return refined.error();
  if (context.cancelled()) return cancelled_error("stand-in");
  const TriangleMesh<double>& fine = *refined ? (*refined)->mesh : mesh;
  // Even triangles before all: closeness comes back when the quads are put on the surface itself.
  Decimator decimator(fine, 1.0, std::sqrt(2 * mesh.total_area() / faces), context,
                      *refined ? carried_marks(mesh, kept, **refined) : kept);
  if (Status status = decimator.reduce(faces, context); !status) return status.error();

  const std::vector<SurfacePoint> sources = *refined ? (*refined)->source : vertex_points(mesh);
  StandIn result;
  std::vector<Index> number(sources.size(), no_index);
  const std::vector<Decimator::Face> left = decimator.faces();
  Triangles triangles(static_cast<Eigen::Index>(left.size()), 3);
  for (std::size_t f = 0; f < left.size(); ++f)
    for (int i = 0; i < 3; ++i) {
      const auto v = static_cast<std::size_t>(left[f][static_cast<std::size_t>(i)]);
      if (number[v] == no_index) {
        number[v] = static_cast<Index>(result.source.size());
        result.source.push_back(sources[v]);
      }
      triangles(static_cast<Eigen::Index>(f), i) = number[v];
    }
  Points<double> positions(static_cast<Eigen::Index>(result.source.size()), 3);
  for (std::size_t v = 0; v < result.source.size(); ++v)
    positions.row(static_cast<Eigen::Index>(v)) = position(mesh, result.source[v]).transpose();
  Expected<TriangleMesh<double>> made = TriangleMesh<double>::create(std::move(positions), std::move(triangles));
  if (!made) return made.error();
  result.mesh = std::move(*made);
  if (!kept.empty())
    for (const Decimator::Face& f : left)
      for (std::size_t i = 0; i < 3; ++i) result.kept.push_back(decimator.kept(f[i], f[(i + 1) % 3]));
  return result;
}

/// Carries points of a stand-in to the surface: along the border and kept edges by arc length, else to the closest
/// point on the sheet that the stand-in's corners lie on.
class OntoSurface {
 public:
  /// \param source of each vertex of `from`, on the surface. Keeps references to these three.
  /// \param from_kept, kept marks of both, or empty
  OntoSurface(const TriangleMesh<double>& from, const std::vector<SurfacePoint>& source, EdgeMarks from_kept,
              const TriangleMesh<double>& surface, const EdgeMarks& kept)
      : from_(from),
        source_(source),
        from_kept_(std::move(from_kept)),
        surface_(surface),
        curves_(surface, joined_marks(border_marks(surface), kept)) {}

  /// \cost a walk over the faces between a corner and the answer; where that goes astray a search of the surface
  [[nodiscard]] SurfacePoint operator()(const SurfacePoint& point) const {
    for (int i = 0; i < 3; ++i)
      if (point.barycentric[i] >= 1 - 1e-12) return source(from_.faces()(point.face, i));
    for (int i = 0; i < 3; ++i) {
      const Index h = 3 * point.face + i;
      if (point.barycentric[(i + 2) % 3] > 1e-9) continue;
      if (from_.twin(h) != no_index && (from_kept_.empty() || !from_kept_[static_cast<std::size_t>(h)])) continue;
      if (const auto on_curve =
              curves_.between(source(from_.origin(h)), source(from_.target(h)), point.barycentric[(i + 1) % 3]))
        return *on_curve;
    }
    const Vector3 p = position(from_, point);
    SurfaceHit best;
    double longest = 0;
    for (int i = 0; i < 3; ++i) {
      const SurfaceHit hit = walk_closest(surface_, p, source(from_.faces()(point.face, i)));
      if (i == 0 || hit.squared_distance < best.squared_distance) best = hit;
      longest = std::max(longest, from_.edge_vector(3 * point.face + i).squaredNorm());
    }
    if (best.squared_distance > 0.01 * longest) {
      if (!search_) search_ = std::make_unique<ClosestPoint>(surface_);
      ClosestFilter filter;
      filter.normal = from_.normal(point.face);
      if (const SurfaceHit hit = search_->closest(p, filter);
          hit.found() && hit.squared_distance < 0.25 * best.squared_distance)
        best = hit;
    }
    return {best.face, best.barycentric};
  }

 private:
  [[nodiscard]] const SurfacePoint& source(Index v) const { return source_[static_cast<std::size_t>(v)]; }

  const TriangleMesh<double>& from_;
  const std::vector<SurfacePoint>& source_;
  EdgeMarks from_kept_;
  const TriangleMesh<double>& surface_;
  EdgeCurves curves_;
  mutable std::unique_ptr<ClosestPoint> search_;
};

}  // namespace quadrig::detail
