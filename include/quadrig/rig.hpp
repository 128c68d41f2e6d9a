// Skeleton, skin weights and clips: what makes a mesh move.
#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCore>

#include "quadrig/mesh.hpp"

namespace quadrig {

/// A directed segment of the skeleton, one per column of the skin weights. Its sign never matters to the field.
struct Bone {
  Vector3 head = Vector3::Zero(), tail = Vector3::Zero();
  /// Bone whose tail (or joint) this one hangs on: transforms are inherited from it. no_index for a root.
  Index parent = no_index;
  /// False where no direction can be told (a leaf whose surface is round): such bones pull no edge.
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
