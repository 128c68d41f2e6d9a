// Closed surfaces of any resolution for tests of fields, and crosses as lines in space.
#pragma once

#include "surfaces.hpp"
#include "test.hpp"

#include "quadrig/asset.hpp"
#include "quadrig/field.hpp"

namespace quadrig::test {

/// An icosahedron whose faces are split in four `levels` times, on the unit sphere: 20 · 4^levels faces. Face f of one
/// level becomes faces 4 f … 4 f + 3 of the next.
[[nodiscard]] inline TriangleMesh<double> ball(int levels) {
  const double a = (1 + std::sqrt(5.0)) / 2;
  Points<double> points(12, 3);
  points << -1, a, 0, 1, a, 0, -1, -a, 0, 1, -a, 0, 0, -1, a, 0, 1, a, 0, -1, -a, 0, 1, -a, a, 0, -1, a, 0, 1, -a, 0,
      -1, -a, 0, 1;
  Triangles faces(20, 3);
  faces << 0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8, 3, 9, 4, 3,
      4, 2, 3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1;
  for (; levels > 0; --levels) {
    const auto mesh = build(points, faces);
    std::vector<Index> middle(static_cast<std::size_t>(mesh.halfedge_count()));
    Index count = mesh.vertex_count();
    points.conservativeResize(count + mesh.edge_count(), 3);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      if (!mesh.is_representative(h)) continue;
      points.row(count) = (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))).transpose() / 2;
      middle[static_cast<std::size_t>(h)] = middle[static_cast<std::size_t>(mesh.twin(h))] = count++;
    }
    faces.resize(4 * mesh.face_count(), 3);
    for (Index f = 0; f < mesh.face_count(); ++f) {
      const auto at = static_cast<std::size_t>(3 * f);
      faces.row(4 * f) << mesh.faces()(f, 0), middle[at], middle[at + 2];
      faces.row(4 * f + 1) << middle[at], mesh.faces()(f, 1), middle[at + 1];
      faces.row(4 * f + 2) << middle[at + 2], middle[at + 1], mesh.faces()(f, 2);
      faces.row(4 * f + 3) << middle[at], middle[at + 1], middle[at + 2];
    }
  }
  points.rowwise().normalize();
  return build(points, faces);
}

/// A smooth body with three unequal limbs in space, star-shaped about the origin: no symmetry, no two limbs alike.
[[nodiscard]] inline Points<double> limbed(const Points<double>& sphere) {
  const std::array<Vector3, 3> limbs{Vector3(1, 0.2, 0.1).normalized(), Vector3(-0.5, 0.9, 0.3).normalized(),
                                     Vector3(-0.3, -0.6, 0.8).normalized()};
  const std::array<double, 3> length{1.6, 1.1, 0.8};
  Points<double> points = sphere;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const Vector3 n = sphere.row(v).transpose();
    double radius = 0.6 + 0.1 * n.x() * n.y() - 0.07 * n.z();
    for (std::size_t k = 0; k < limbs.size(); ++k) radius += length[k] * std::exp(5 * (n.dot(limbs[k]) - 1));
    points.row(v) = radius * n.transpose();
  }
  return points;
}

/// The body with a bone in each limb and one across the trunk, weights smooth in the direction from the origin.
[[nodiscard]] inline Asset limbed_asset(int levels, bool rigged) {
  const auto sphere = ball(levels);
  Asset asset{build(limbed(sphere.positions()), sphere.faces()), {}};
  if (!rigged) return asset;
  asset.rig.emplace();
  const std::array<Vector3, 4> ends{2 * Vector3(1, 0.2, 0.1), 2 * Vector3(-0.5, 0.9, 0.3), 2 * Vector3(-0.3, -0.6, 0.8),
                                    Vector3(0, -0.3, -0.7)};
  for (const Vector3& end : ends) {
    Bone bone;
    bone.tail = end;
    asset.rig->skeleton.bones.push_back(bone);
  }
  asset.rig->weights.resize(sphere.vertex_count(), 4);
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < sphere.vertex_count(); ++v) {
    std::array<double, 4> weight{};
    double sum = 0;
    for (std::size_t b = 0; b < 4; ++b) sum += weight[b] = std::exp(6 * sphere.position(v).dot(ends[b].normalized()));
    for (std::size_t b = 0; b < 4; ++b) entries.emplace_back(v, static_cast<Index>(b), weight[b] / sum);
  }
  asset.rig->weights.setFromTriplets(entries.begin(), entries.end());
  return asset;
}

/// One arm of each face's bisecting cross, in space.
[[nodiscard]] inline std::vector<Vector3> cross_arms(const Asset& asset, const FrameField& frames) {
  const Connection<double> connection(asset.mesh);
  std::vector<Vector3> arms;
  for (Index f = 0; f < frames.face_count(); ++f) {
    const auto k = static_cast<std::size_t>(f);
    arms.push_back(
        connection.to_vector(f, std::polar(1.0, bisector_angle(frames.u[k], frames.v[k]) - std::numbers::pi / 4)));
  }
  return arms;
}

/// Angle between two crosses in nearly parallel planes, degrees in [0, 45].
[[nodiscard]] inline double cross_angle(const Vector3& arm, const Vector3& other, const Vector3& normal) {
  const Vector3 flat = (other - other.dot(normal) * normal).normalized();
  const double angle = std::atan2(arm.cross(flat).dot(normal), arm.dot(flat));
  return std::abs(std::remainder(angle, std::numbers::pi / 2)) * 180 / std::numbers::pi;
}

}  // namespace quadrig::test
