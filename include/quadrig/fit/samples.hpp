// Points of a surface that stand for all of it: by area, and one of every triangle unless there are very many.
#pragma once

#include "quadrig/mesh.hpp"

namespace quadrig::detail {

struct SurfaceSamples {
  std::vector<SurfacePoint> point;
  std::vector<Vector3> position, normal;  ///< normal of the face
  std::vector<double> area;               ///< that the sample stands for

  [[nodiscard]] std::size_t size() const { return point.size(); }
};

/// At least `least` samples in all and at least one a triangle, but only about `most`, then chosen by area alone.
/// \pre 0 < least ≤ most. \cost O(faces + samples). Triangles without area have none.
inline SurfaceSamples sample_surface(const TriangleMesh<double>& mesh, double least, double most) {
  SurfaceSamples samples;
  const double total = mesh.total_area();
  if (!(total > 0)) return samples;
  const auto add = [&](Index f, const Vector3& barycentric, double area) {
    samples.point.push_back({f, barycentric});
    samples.position.push_back(position(mesh, samples.point.back()));
    samples.normal.push_back(mesh.normal(f));
    samples.area.push_back(area);
  };
  const Vector3 centre = Vector3::Constant(1.0 / 3);
  if (mesh.face_count() > most) {
    const double step = total / most;
    double passed = step / 2;
    for (Index f = 0; f < mesh.face_count(); ++f) {
      passed += mesh.area(f);
      if (passed < step || !(mesh.area(f) > 0)) continue;
      const double steps = std::floor(passed / step);
      add(f, centre, steps * step);
      passed -= steps * step;
    }
    return samples;
  }
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (!(mesh.area(f) > 0)) continue;
    const auto count = static_cast<int>(std::ceil(least * mesh.area(f) / total));
    if (count <= 1) {
      add(f, centre, mesh.area(f));
      continue;
    }
    // The additive recurrence of the plastic number spreads any count evenly over the square; half of it is folded.
    constexpr double plastic = 1.32471795724474602596;
    double u = 0.5, v = 0.5;
    for (int k = 0; k < count; ++k) {
      u += 1 / plastic, u -= std::floor(u);
      v += 1 / (plastic * plastic), v -= std::floor(v);
      const bool folded = u + v > 1;
      const double x = folded ? 1 - u : u, y = folded ? 1 - v : v;
      add(f, {1 - x - y, x, y}, mesh.area(f) / count);
    }
  }
  return samples;
}

}  // namespace quadrig::detail
