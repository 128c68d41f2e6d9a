// Samples of one surface to the other, and back.
#include "measure.hpp"

#include "quadrig/quality/distance.hpp"

namespace quadrig::gltf {
namespace {

Index samples_of(const Triangles& faces) {
  return static_cast<Index>(std::clamp<Eigen::Index>(6 * faces.rows(), 300, 3000));
}

}  // namespace

Measure::Measure(Triangles faces, PosedPoints points) : faces_(std::move(faces)), points_(std::move(points)) {
  for (const Points<double>& places : points_.places) trees_.emplace_back(places, faces_);
  Eigen::AlignedBox3d box;
  for (Eigen::Index k = 0; k < faces_.size(); ++k)
    box.extend(Vector3(points_.places[0].row(faces_(k / 3, k % 3)).transpose()));
  diagonal_ = box.diagonal().norm();
}

Apart Measure::apart(const Triangles& faces, std::span<const Points<double>> places) const {
  Apart sum;
  double weight = 0;
  const auto one_way = [&](const Points<double>& from, const Triangles& of, const ClosestPoint& to, double share,
                           double& largest) {
    const std::vector<SurfacePoint> samples = sample_surface(from, of, samples_of(of), 7);
    if (samples.empty()) return;
    const double each = share / static_cast<double>(samples.size());
    for (const SurfacePoint& sample : samples) {
      Vector3 p = Vector3::Zero();
      for (int i = 0; i < 3; ++i) p += sample.barycentric[i] * from.row(of(sample.face, i)).transpose();
      const double squared = to.closest(p).squared_distance;
      sum.rms += each * squared;
      sum.mean += each * std::sqrt(squared);
      largest = std::max(largest, squared);
    }
    weight += share;
    const auto corners = std::min<Eigen::Index>(of.size(), 6000);
    for (Eigen::Index k = 0; k < corners; ++k) {
      const Eigen::Index c = k * (of.size() / corners);
      largest = std::max(largest, to.closest(from.row(of(c / 3, c % 3)).transpose()).squared_distance);
    }
  };
  for (std::size_t k = 0; k < places.size(); ++k) {
    const ClosestPoint back(places[k], faces);
    double largest = 0;
    one_way(points_.places[k], faces_, back, points_.weight[k], largest);
    one_way(places[k], faces, trees_[k], points_.weight[k], largest);
    sum.largest = std::max(sum.largest, largest);
    if (k == 0 || k > points_.bends) sum.largest_unbent = std::max(sum.largest_unbent, largest);
  }
  if (!(weight > 0)) return {};
  return {std::sqrt(sum.rms / weight), sum.mean / weight, std::sqrt(sum.largest), std::sqrt(sum.largest_unbent)};
}

Triangles as_triangles(std::span<const Polygon> polygons) {
  Triangles faces(triangle_count(polygons), 3);
  Eigen::Index next = 0;
  for (const Polygon& p : polygons) {
    faces.row(next++) << p.vertex[0], p.vertex[1], p.vertex[2];
    if (p.size() == 4) faces.row(next++) << p.vertex[0], p.vertex[2], p.vertex[3];
  }
  return faces;
}

}  // namespace quadrig::gltf
