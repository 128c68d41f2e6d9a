// Definitions of quality/distance.hpp.
#pragma once

#include "quadrig/quality/distance.hpp"

namespace quadrig {

QUADRIG_INLINE Triangles fan_triangles(const PolygonMesh& mesh) {
  Index count = 0;
  for (Index f = 0; f < mesh.polygon_count(); ++f)
    count += std::max<Index>(0, static_cast<Index>(mesh.polygon(f).size()) - 2);
  Triangles result(count, 3);
  Index row = 0;
  for (Index f = 0; f < mesh.polygon_count(); ++f) {
    const auto polygon = mesh.polygon(f);
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) result.row(row++) << polygon[0], polygon[k], polygon[k + 1];
  }
  return result;
}

QUADRIG_INLINE std::vector<SurfacePoint> sample_surface(const Points<double>& positions, const Triangles& faces,
                                                        Index count, std::uint64_t seed) {
  std::vector<double> until(static_cast<std::size_t>(faces.rows()));  // area of the faces up to and with this one
  double area = 0;
  for (Index f = 0; f < faces.rows(); ++f) {
    const Vector3 a = positions.row(faces(f, 0)).transpose(), b = positions.row(faces(f, 1)).transpose();
    const Vector3 c = positions.row(faces(f, 2)).transpose();
    until[static_cast<std::size_t>(f)] = area += (b - a).cross(c - a).norm() / 2;
  }
  std::vector<SurfacePoint> points;
  if (!(area > 0)) return points;
  points.reserve(static_cast<std::size_t>(count));
  std::mt19937_64 engine(seed);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  std::size_t face = 0;
  for (Index k = 0; k < count; ++k) {
    const double at = (k + uniform()) / count * area;
    while (face + 1 < until.size() && until[face] <= at) ++face;
    double u = uniform(), v = uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    points.push_back({static_cast<Index>(face), {1 - u - v, u, v}});
  }
  return points;
}

QUADRIG_INLINE Points<double> positions_at(const Points<double>& positions, const Triangles& faces,
                                           std::span<const SurfacePoint> points) {
  Points<double> result(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto t = faces.row(points[k].face);
    const Vector3& b = points[k].barycentric;
    result.row(static_cast<Eigen::Index>(k)) =
        b[0] * positions.row(t[0]) + b[1] * positions.row(t[1]) + b[2] * positions.row(t[2]);
  }
  return result;
}

QUADRIG_INLINE Status DistanceOptions::validate() const {
  if (samples < 1) return Error{ErrorCode::bad_option, "less than 1", "samples", "give 1 or more"};
  return {};
}

QUADRIG_INLINE Expected<SurfaceDistance> surface_distance(const Points<double>& input_positions,
                                                          const Triangles& input_faces, const Points<double>& positions,
                                                          const Triangles& faces, const DistanceOptions& options,
                                                          Context& context) {
  if (Status status = options.validate(); !status) return status.error();
  bool flat = false;
  const auto one_way = [&](const Points<double>& from, const Triangles& from_faces, const Points<double>& to,
                           const Triangles& to_faces) {
    DistanceFigures figures;
    const std::vector<SurfacePoint> samples = sample_surface(from, from_faces, options.samples, options.seed);
    if (samples.empty() || to_faces.rows() == 0) {
      flat = true;
      return figures;
    }
    const Points<double> points = positions_at(from, from_faces, samples);
    std::vector<char> used(static_cast<std::size_t>(from.rows()), 0);
    for (Eigen::Index i = 0; i < from_faces.size(); ++i) used[static_cast<std::size_t>(from_faces.data()[i])] = 1;
    const ClosestPoint tree(to, to_faces);
    const auto sample_count = static_cast<std::size_t>(points.rows());
    std::vector<double> squared(sample_count + used.size(), 0);
    context.parallel_for(squared.size(), 1000, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        if (k % 1024 == 0 && context.cancelled()) return;
        if (k >= sample_count && !used[k - sample_count]) continue;
        const Vector3 p = k < sample_count ? Vector3(points.row(static_cast<Eigen::Index>(k)).transpose())
                                           : Vector3(from.row(static_cast<Eigen::Index>(k - sample_count)).transpose());
        squared[k] = tree.closest(p).squared_distance;
      }
    });
    for (std::size_t k = 0; k < squared.size(); ++k) {
      figures.maximum = std::max(figures.maximum, std::sqrt(squared[k]));
      if (k >= sample_count) continue;
      figures.mean += std::sqrt(squared[k]) / static_cast<double>(sample_count);
      figures.rms += squared[k] / static_cast<double>(sample_count);
    }
    figures.rms = std::sqrt(figures.rms);
    return figures;
  };
  SurfaceDistance result;
  result.to_input = one_way(positions, faces, input_positions, input_faces);
  result.from_input = one_way(input_positions, input_faces, positions, faces);
  if (context.cancelled()) return cancelled_error("surface distance");
  if (flat)
    return Error{ErrorCode::bad_input, "a surface has no area", "surface distance", "compare surfaces with faces"};
  return result;
}

}  // namespace quadrig
