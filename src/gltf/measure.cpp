// Samples of one surface to the other, and back.
#include "measure.hpp"

#include "quadrig/quality/distance.hpp"

namespace quadrig::gltf {
namespace {

Index samples_of(const Triangles& faces) {
  return static_cast<Index>(std::clamp<Eigen::Index>(6 * faces.rows(), 300, 3000));
}

/// The triangles of each material by themselves, where there are several.
std::map<Index, MaterialPart> by_material(const Points<double>& places, const Triangles& faces,
                                          const std::vector<Index>& materials) {
  std::map<Index, std::vector<Eigen::Index>> rows;
  for (std::size_t f = 0; f < materials.size(); ++f) rows[materials[f]].push_back(static_cast<Eigen::Index>(f));
  std::map<Index, MaterialPart> parts;
  if (rows.size() < 2) return parts;
  for (const auto& [material, own] : rows) {
    const Triangles part(faces(own, Eigen::all));
    parts.emplace(material, MaterialPart{part, ClosestPoint(places, part)});
  }
  return parts;
}

Vector3 place_of(const SurfacePoint& sample, const Points<double>& places, const Triangles& faces) {
  Vector3 p = Vector3::Zero();
  for (int i = 0; i < 3; ++i) p += sample.barycentric[i] * places.row(faces(sample.face, i)).transpose();
  return p;
}

/// Mean squared distance of each material's places from the other's of that material, the mean of all materials.
double misplaced(const Points<double>& from, const std::map<Index, MaterialPart>& parts,
                 const std::map<Index, MaterialPart>& to, double farthest) {
  constexpr Index samples = 100;
  double sum = 0;
  for (const auto& [material, part] : parts) {
    const auto other = to.find(material);
    const std::vector<SurfacePoint> places = sample_surface(from, part.faces, samples, 7);
    double squared = 0;
    for (const SurfacePoint& sample : places)
      squared += other == to.end() ? farthest * farthest
                                   : other->second.tree.closest(place_of(sample, from, part.faces)).squared_distance;
    if (!places.empty()) sum += squared / static_cast<double>(places.size());
  }
  return sum / static_cast<double>(parts.size());
}

}  // namespace

Measure::Measure(Triangles faces, PosedPoints points, std::vector<Index> materials)
    : faces_(std::move(faces)), points_(std::move(points)), materials_(std::move(materials)) {
  parts_ = by_material(points_.places[0], faces_, materials_);
  for (const Points<double>& places : points_.places) trees_.emplace_back(places, faces_);
  Eigen::AlignedBox3d box;
  for (Eigen::Index k = 0; k < faces_.size(); ++k)
    box.extend(Vector3(points_.places[0].row(faces_(k / 3, k % 3)).transpose()));
  diagonal_ = box.diagonal().norm();
}

Apart Measure::apart(const Triangles& faces, std::span<const Points<double>> places,
                     const std::vector<Index>& materials) const {
  Apart sum;
  double weight = 0;
  const auto one_way = [&](const Points<double>& from, const Triangles& of, const ClosestPoint& to, double share,
                           double& largest) {
    const std::vector<SurfacePoint> samples = sample_surface(from, of, samples_of(of), 7);
    if (samples.empty()) return;
    const double each = share / static_cast<double>(samples.size());
    for (const SurfacePoint& sample : samples) {
      const double squared = to.closest(place_of(sample, from, of)).squared_distance;
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
  double colours = 0;
  if (const auto parts = by_material(places[0], faces, materials); !parts_.empty() && !parts.empty())
    colours =
        (misplaced(points_.places[0], parts_, parts, diagonal_) + misplaced(places[0], parts, parts_, diagonal_)) / 2;
  const double squared = sum.rms / weight;
  return {std::sqrt(squared), sum.mean / weight, std::sqrt(squared + colours), std::sqrt(sum.largest),
          std::sqrt(sum.largest_unbent)};
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
