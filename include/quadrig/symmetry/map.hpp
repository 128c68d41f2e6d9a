// From one side of a body to the other, also where the two do not stand alike: an arm that is raised, a bent spine.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/symmetry.hpp"

namespace quadrig::detail {

/// Takes points to their mirror images: by the plane, or, where a rig says better, each bone's surroundings to those of
/// its twin, blended by the skin weights.
class MirrorMap {
 public:
  /// By the plane alone.
  explicit MirrorMap(const MirrorPlane& plane) : plane_(plane) {}

  /// By the bones where the body is lopsided and they take it nearer to itself. Keeps references to both.
  /// \cost some thousand closest points where the plane does not do
  MirrorMap(const Asset& asset, const MirrorPlane& plane) : plane_(plane) {
    constexpr double symmetric = 0.9;
    if (!asset.rig || plane.twin.empty() || plane.share >= symmetric) return;
    const std::vector<Eigen::Affine3d> maps = bone_maps(asset.rig->skeleton, plane);
    const ClosestPoint closest(asset.mesh);
    const double by_plane = distance(asset, closest);
    of_bone_ = maps;
    if (!(distance(asset, closest) < by_plane)) of_bone_.clear();
  }

  [[nodiscard]] const MirrorPlane& plane() const { return plane_; }
  [[nodiscard]] bool by_bones() const { return !of_bone_.empty(); }

  /// The image of a point that has these weights, a row of them.
  [[nodiscard]] Vector3 operator()(const Vector3& p, const SkinWeights* weights, Index row) const {
    return blended(weights, row) * p;
  }
  /// The image of a point of an asset's surface, and of the normal there.
  [[nodiscard]] Vector3 operator()(const Asset& asset, const SurfacePoint& point, Vector3* normal = nullptr) const {
    Eigen::Affine3d map = of_plane();
    if (by_bones()) {
      map.matrix().setZero();
      for (int i = 0; i < 3; ++i)
        map.matrix() += point.barycentric[i] * blended(&asset.rig->weights, asset.mesh.faces()(point.face, i)).matrix();
    }
    if (normal) *normal = map.linear() * asset.mesh.normal(point.face);
    return map * position(asset.mesh, point);
  }
  /// How far a point lies on the plane's side of the middle between it and its image.
  [[nodiscard]] double side(const Vector3& p, const SkinWeights* weights, Index row) const {
    return by_bones() ? plane_.normal.dot(p - (*this)(p, weights, row)) / 2 : plane_.side(p);
  }

 private:
  [[nodiscard]] Eigen::Affine3d of_plane() const {
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    map.linear() -= 2 * plane_.normal * plane_.normal.transpose();
    map.translation() = 2 * plane_.offset * plane_.normal;
    return map;
  }
  [[nodiscard]] Eigen::Affine3d blended(const SkinWeights* weights, Index row) const {
    if (!by_bones() || !weights) return of_plane();
    Eigen::Affine3d map;
    map.matrix().setZero();
    for (SkinWeights::InnerIterator it(*weights, row); it; ++it)
      map.matrix() += it.value() * of_bone_[at(static_cast<Index>(it.col()))].matrix();
    return map;
  }

  /// Of each bone the map that takes it to its twin: mirrored, then turned and stretched along as the twin is.
  [[nodiscard]] std::vector<Eigen::Affine3d> bone_maps(const Skeleton& skeleton, const MirrorPlane& plane) const {
    std::vector<Eigen::Affine3d> maps(skeleton.bones.size(), of_plane());
    for (std::size_t b = 0; b < maps.size(); ++b) {
      if (b >= plane.twin.size() || plane.twin[b] == no_index) continue;
      const Bone &bone = skeleton.bones[b], &twin = skeleton.bones[at(plane.twin[b])];
      const Vector3 image = plane.mirrored(bone.head);
      Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
      const double from = (bone.tail - bone.head).norm(), to = (twin.tail - twin.head).norm();
      constexpr double least = 1e-3;  // of the other's length
      if (bone.has_direction && twin.has_direction && from > least * to && to > least * from) {
        const Vector3 along = twin.direction();
        const Eigen::Matrix3d rotation =
            Eigen::Quaterniond::FromTwoVectors(plane.mirrored_direction(bone.direction()), along).toRotationMatrix();
        const Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity() + (to / from - 1) * along * along.transpose();
        turn = stretch * rotation;
      }
      Eigen::Affine3d move = Eigen::Translation3d(twin.head) * Eigen::Affine3d(turn) * Eigen::Translation3d(-image);
      maps[b] = move * maps[b];
    }
    return maps;
  }

  /// Mean distance of the images of faces from the surface.
  [[nodiscard]] double distance(const Asset& asset, const ClosestPoint& closest) const {
    constexpr Index probes = 2000;
    const Index step = std::max<Index>(1, asset.mesh.face_count() / probes);
    double sum = 0, area = 0;
    for (Index f = 0; f < asset.mesh.face_count(); f += step) {
      ClosestFilter filter;
      filter.minimum_cosine = 0.3;
      const Vector3 p = (*this)(asset, {f, Vector3::Constant(1.0 / 3)}, &filter.normal);
      SurfaceHit hit = closest.closest(p, filter);
      if (!hit.found()) hit = closest.closest(p);
      sum += asset.mesh.area(f) * std::sqrt(hit.squared_distance);
      area += asset.mesh.area(f);
    }
    return area > 0 ? sum / area : 0;
  }

  const MirrorPlane& plane_;
  std::vector<Eigen::Affine3d> of_bone_;  // empty: by the plane
};

}  // namespace quadrig::detail
