// Skeleton, skin weights and clips.
#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCore>

#include <span>

#include "quadrig/mesh.hpp"

namespace quadrig {

/// A directed segment of the skeleton, one per column of the skin weights. Its sign never matters to the field.
struct Bone {
  Vector3 head = Vector3::Zero(), tail = Vector3::Zero();
  /// Bone whose tail (or joint) this one hangs on: transforms are inherited from it. no_index for a root.
  Index parent = no_index;
  /// False where no direction is known (a leaf whose surface is round): such bones do not guide edges.
  bool has_direction = true;
  std::string name = {};

  [[nodiscard]] Vector3 direction() const {
    const Vector3 d = tail - head;
    const double length = d.norm();
    return length > 0 ? Vector3(d / length) : Vector3::Zero();
  }
};

struct Skeleton {
  std::vector<Bone> bones;
  [[nodiscard]] Index bone_count() const { return static_cast<Index>(bones.size()); }
};

/// n×b, one row a vertex, entries ≥ 0, rows sum to 1.
using SkinWeights = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

/// Rows of weights, in any order and any of them more than once. \cost O(their entries)
[[nodiscard]] inline SkinWeights rows_of(const SkinWeights& weights, std::span<const Index> rows) {
  SkinWeights result(static_cast<Index>(rows.size()), weights.cols());
  Index entries = 0;
  for (const Index row : rows) entries += static_cast<Index>(weights.innerVector(row).nonZeros());
  result.reserve(entries);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    result.startVec(static_cast<Index>(k));
    for (SkinWeights::InnerIterator it(weights, rows[k]); it; ++it)
      result.insertBack(static_cast<Index>(k), it.col()) = it.value();
  }
  result.finalize();
  return result;
}

/// A bone and its share of a vertex or face.
struct BoneShare {
  Index bone = no_index;
  double weight = 0;
  /// Falling weight, ties by the lower bone.
  [[nodiscard]] static bool stronger(const BoneShare& a, const BoneShare& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.bone < b.bone;
  }
};

/// Keeps the `influences` strongest shares, strongest first, without those that have no weight, and scales them to sum
/// 1. Returns false, and leaves nothing, where no share has a weight. \pre each bone once. \cost O(k log k)
inline bool keep_strongest(std::vector<BoneShare>& shares, Index influences) {
  std::sort(shares.begin(), shares.end(), BoneShare::stronger);
  if (shares.size() > detail::at(influences)) shares.resize(detail::at(influences));
  while (!shares.empty() && !(shares.back().weight > 0)) shares.pop_back();
  double sum = 0;
  for (const BoneShare& share : shares) sum += share.weight;
  for (BoneShare& share : shares) share.weight /= sum;
  return !shares.empty();
}

/// One rigid or affine transform per bone, from the rest (bind) pose: posed = transform * rest.
using Pose = std::vector<Eigen::Affine3d>;

/// A sampled animation: the pose at each time, seconds ascending.
struct Clip {
  std::string name = {};
  std::vector<double> times_seconds;
  std::vector<Pose> poses;
};

struct Rig {
  Skeleton skeleton;
  SkinWeights weights;
  std::vector<Clip> clips;
};

}  // namespace quadrig
