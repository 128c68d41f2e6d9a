// What a surface is simplified from: fine enough that collapses have a choice.
#pragma once

#include "quadrig/prepare.hpp"

namespace quadrig::detail {

/// Each vertex of a mesh as a point of it.
[[nodiscard]] inline std::vector<SurfacePoint> vertex_points(const TriangleMesh<double>& mesh) {
  std::vector<SurfacePoint> points(static_cast<std::size_t>(mesh.vertex_count()));
  for (Index corner = 3 * mesh.face_count() - 1; corner >= 0; --corner)
    points[static_cast<std::size_t>(mesh.origin(corner))] = {corner / 3, Vector3::Unit(corner % 3)};
  return points;
}

/// The surface with three times the faces wanted or more, its edges shorter than those of that many even triangles.
/// Nothing where the mesh itself must do. \fails cancelled
[[nodiscard]] inline Expected<std::optional<Refinement>> refined_to_choose(const TriangleMesh<double>& mesh,
                                                                           Index faces_wanted, RefineOptions options,
                                                                           Context& context) {
  // Collapses choose among the vertices that are there: about five times as many triangles as wanted give a choice.
  double length = 0.6 * std::sqrt(4 / std::sqrt(3.0) * mesh.total_area() / faces_wanted);
  // Long needles would fall into far more pieces than that: then longer edges must do.
  options.max_faces = static_cast<Index>(std::min<std::int64_t>(
      options.max_faces, 5'000 + 2 * std::int64_t{mesh.face_count()} + 30 * std::int64_t{faces_wanted}));
  std::optional<Refinement> refined;
  for (int attempt = 0; attempt < 60 && length > 0 && std::isfinite(length); ++attempt) {
    Expected<Refinement> finer = refine(
        mesh, [&](Index) { return length; }, options, context);
    if (!finer) {
      if (finer.error().code == ErrorCode::cancelled) return finer.error();
      if (refined) break;
      length *= 1.6;
      continue;
    }
    refined = std::move(*finer);
    if (refined->mesh.face_count() >= 3 * std::int64_t{faces_wanted}) break;
    length /= 1.3;
  }
  return refined;
}

}  // namespace quadrig::detail
