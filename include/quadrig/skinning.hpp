// Poses applied to points: linear blend and dual quaternion skinning, and the bends that a rig is tested with.
#pragma once

#include <algorithm>
#include <array>
#include <numbers>
#include <span>

#include "quadrig/rig.hpp"

namespace quadrig {

enum class Skinning : std::uint8_t {
  linear_blend,     ///< weights average the transforms; elbows collapse under large bends
  dual_quaternion,  ///< weights average the rotations (Kavan et al. 2008); scale and shear are averaged first
};

/// Every bone at rest.
[[nodiscard]] inline Pose rest_pose(const Skeleton& skeleton) {
  return Pose(skeleton.bones.size(), Eigen::Affine3d::Identity());
}

/// The bone and every bone below it, lowest number first. Parents that form a ring are followed once.
[[nodiscard]] std::vector<Index> bones_below(const Skeleton& skeleton, Index bone);

/// The pose in which `bone` and all below it turn about its head, by `radians` about `axis`; the others rest.
/// \pre the axis is not zero
[[nodiscard]] Pose bend(const Skeleton& skeleton, Index bone, const Vector3& axis, double radians);

/// Four poses a bone: it bends by ±degrees about two axes across it, first −, then +, about
/// a = d × z (d × x where the bone is within 26° of z), then the same about d × a. Rest is not among them. A bone of
/// zero length is treated as if it ran along x.
[[nodiscard]] std::vector<Pose> bend_poses(const Skeleton& skeleton, double degrees = 60);

/// Those of bend_poses in which a surface bends, for the bones that carry weight alone.
struct SurfaceBends {
  SkinWeights weights;       ///< n×c, the columns of the bones that carry weight
  std::vector<Index> bones;  ///< c: these bones, ascending
  std::vector<Pose> poses;   ///< c transforms each, in the order of bend_poses
  Index still = 0;           ///< poses that are not among them: the surface is carried along whole, or not at all
  Index left_out = 0;        ///< bones beyond the most, whose poses count as still
};
/// Where the poses would be of more than `most_transforms` transforms together, those bones bend that carry most
/// weight. \pre weights has one column a bone \cost O(n + b log b + p c) time and memory for b bones and p poses.
/// \fails never.
[[nodiscard]] SurfaceBends surface_bends(const Skeleton& skeleton, const SkinWeights& weights, double degrees = 60,
                                         Index most_transforms = 1 << 20);

/// At most `most` frames of the clips together, each clip by its share of the frames (at least one), evenly spaced and
/// with its first. \pre most > 0
[[nodiscard]] std::vector<Pose> clip_poses(std::span<const Clip> clips, Index most);

/// The points, n×3, moved by the pose. A point without weights stays.
/// \pre weights is n×b, rows sum to 1; pose has b transforms
/// \cost O(nonzero weights). \fails never.
[[nodiscard]] Points<double> skin(const Points<double>& points, const SkinWeights& weights, const Pose& pose,
                                  Skinning method = Skinning::linear_blend);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void skin(const Arguments&...) = delete;  // see with_columns

/// Numbers the bones by equal transforms: bones that share a number move as one body. Numbers ascend from 0.
[[nodiscard]] std::vector<Index> rigid_groups(const Pose& pose);

/// Per point, 1 minus the largest share of its weights that one transform of the pose holds: 0 where it moves rigidly.
/// \pre as for skin
[[nodiscard]] Eigen::VectorXd blending(const SkinWeights& weights, const Pose& pose);

// Definitions ------------------------------------------------------------------------------------------------------

inline std::vector<Index> bones_below(const Skeleton& skeleton, Index bone) {
  enum : signed char { unknown, walking, yes, no };
  const auto count = static_cast<std::size_t>(skeleton.bone_count());
  std::vector<signed char> below(count, unknown);
  below[static_cast<std::size_t>(bone)] = yes;
  std::vector<Index> path, all;
  for (std::size_t b = 0; b < count; ++b) {
    path.clear();
    Index up = static_cast<Index>(b);
    for (; up != no_index && below[static_cast<std::size_t>(up)] == unknown;
         up = skeleton.bones[static_cast<std::size_t>(up)].parent) {
      below[static_cast<std::size_t>(up)] = walking;
      path.push_back(up);
    }
    const signed char found = up != no_index && below[static_cast<std::size_t>(up)] == yes ? yes : no;
    for (const Index walked : path) below[static_cast<std::size_t>(walked)] = found;
    if (below[b] == yes) all.push_back(static_cast<Index>(b));
  }
  return all;
}

namespace detail {

/// The two axes across a bone that bend_poses turns it about.
inline std::array<Vector3, 2> bend_axes(const Bone& bone) {
  Vector3 d = bone.tail - bone.head;
  if (!(d.norm() > 0)) d = Vector3::UnitX();
  const Vector3 a = d.cross(std::abs(d.z()) < 0.9 * d.norm() ? Vector3::UnitZ() : Vector3::UnitX());
  return {a, d.cross(a)};
}

/// The turn about the head of the bone.
inline Eigen::Affine3d bend_transform(const Bone& bone, const Vector3& axis, double radians) {
  const Eigen::Matrix3d turn = elementary::rotation(radians, axis.normalized());
  Eigen::Affine3d transform;
  transform.linear() = turn;
  transform.translation() = bone.head - turn * bone.head;
  transform.makeAffine();
  return transform;
}

}  // namespace detail

inline Pose bend(const Skeleton& skeleton, Index bone, const Vector3& axis, double radians) {
  const Eigen::Affine3d transform =
      detail::bend_transform(skeleton.bones[static_cast<std::size_t>(bone)], axis, radians);
  Pose pose = rest_pose(skeleton);
  for (const Index b : bones_below(skeleton, bone)) pose[static_cast<std::size_t>(b)] = transform;
  return pose;
}

inline std::vector<Pose> bend_poses(const Skeleton& skeleton, double degrees) {
  std::vector<Pose> poses;
  for (Index b = 0; b < skeleton.bone_count(); ++b)
    for (const Vector3& axis : detail::bend_axes(skeleton.bones[static_cast<std::size_t>(b)]))
      for (const double sign : {-1.0, 1.0})
        poses.push_back(bend(skeleton, b, axis, sign * degrees * std::numbers::pi / 180));
  return poses;
}

inline SurfaceBends surface_bends(const Skeleton& skeleton, const SkinWeights& weights, double degrees,
                                  Index most_transforms) {
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  const Index count = skeleton.bone_count();
  std::vector<double> carried(at(count), 0.0);
  for (Index v = 0; v < weights.rows(); ++v)
    for (SkinWeights::InnerIterator it(weights, v); it; ++it) carried[at(static_cast<Index>(it.col()))] += it.value();
  std::vector<Index> column(at(count), no_index);  // of the bones that carry weight
  Index columns = 0;
  SurfaceBends result;
  for (Index b = 0; b < count; ++b)
    if (carried[at(b)] > 0) {
      column[at(b)] = columns++;
      result.bones.push_back(b);
    }

  // Bones in the order of a walk down the tree: what is below one follows it. Rings of parents have no place in it.
  std::vector<std::vector<Index>> children(at(count));
  std::vector<Index> stack, walk, first(at(count), no_index), last(at(count), no_index), used_before(1, 0);
  for (Index b = count; b-- > 0;)
    if (const Index parent = skeleton.bones[at(b)].parent; parent == no_index)
      stack.push_back(b);
    else
      children[at(parent)].push_back(b);
  while (!stack.empty()) {
    const Index b = stack.back();
    if (first[at(b)] == no_index) {
      first[at(b)] = static_cast<Index>(walk.size());
      walk.push_back(b);
      used_before.push_back(used_before.back() + (column[at(b)] != no_index ? 1 : 0));
      stack.insert(stack.end(), children[at(b)].begin(), children[at(b)].end());
      continue;
    }
    stack.pop_back();
    last[at(b)] = static_cast<Index>(walk.size());
  }
  const auto below = [&](Index b) {
    return first[at(b)] == no_index ? bones_below(skeleton, b)
                                    : std::vector<Index>(walk.begin() + first[at(b)], walk.begin() + last[at(b)]);
  };
  std::vector<Index> bent;
  for (Index b = 0; b < count; ++b) {
    Index used = 0;
    if (first[at(b)] != no_index)
      used = used_before[at(last[at(b)])] - used_before[at(first[at(b)])];
    else
      for (const Index under : below(b)) used += column[at(under)] != no_index ? 1 : 0;
    if (used > 0 && used < columns) bent.push_back(b);
  }
  const Index most_bones = most_transforms / std::max(4 * columns, Index{1});
  if (static_cast<Index>(bent.size()) > most_bones) {
    result.left_out = static_cast<Index>(bent.size()) - most_bones;
    std::stable_sort(bent.begin(), bent.end(), [&](Index a, Index b) { return carried[at(a)] > carried[at(b)]; });
    bent.resize(at(most_bones));
    std::sort(bent.begin(), bent.end());
  }
  for (const Index b : bent) {
    std::vector<Index> moved;
    for (const Index under : below(b))
      if (column[at(under)] != no_index) moved.push_back(column[at(under)]);
    const Bone& bone = skeleton.bones[at(b)];
    for (const Vector3& axis : detail::bend_axes(bone))
      for (const double sign : {-1.0, 1.0}) {
        Pose& pose = result.poses.emplace_back(at(columns), Eigen::Affine3d::Identity());
        const Eigen::Affine3d turn = detail::bend_transform(bone, axis, sign * degrees * std::numbers::pi / 180);
        for (const Index c : moved) pose[at(c)] = turn;
      }
  }
  result.still = 4 * count - static_cast<Index>(result.poses.size());
  result.weights.resize(weights.rows(), columns);
  result.weights.reserve(weights.nonZeros());
  for (Index v = 0; v < weights.rows(); ++v) {
    result.weights.startVec(v);
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      if (const Index c = column[at(static_cast<Index>(it.col()))]; c != no_index)
        result.weights.insertBack(v, c) = it.value();
  }
  result.weights.finalize();
  return result;
}

inline std::vector<Pose> clip_poses(std::span<const Clip> clips, Index most) {
  std::size_t frames = 0;
  for (const Clip& clip : clips) frames += clip.poses.size();
  std::vector<Pose> poses;
  for (const Clip& clip : clips) {
    const std::size_t own = clip.poses.size();
    if (own == 0) continue;
    const std::size_t wanted = static_cast<std::size_t>(most) >= frames
                                   ? own
                                   : std::clamp<std::size_t>(own * static_cast<std::size_t>(most) / frames, 1, own);
    for (std::size_t k = 0; k < wanted && poses.size() < static_cast<std::size_t>(most); ++k)
      poses.push_back(clip.poses[k * own / wanted]);
  }
  return poses;
}

namespace detail {

/// A rigid motion as a unit dual quaternion, after the stretch that the transform began with.
struct DualQuaternion {
  Eigen::Quaterniond real, dual;
  Eigen::Matrix3d stretch;
};

inline DualQuaternion dual_quaternion(const Eigen::Affine3d& transform) {
  // Polar decomposition: linear = rotation * stretch.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(transform.linear(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if (u.determinant() * svd.matrixV().determinant() < 0) u.col(2) = -u.col(2);
  const Eigen::Matrix3d rotation = u * svd.matrixV().transpose();
  DualQuaternion q;
  q.real = Eigen::Quaterniond(rotation).normalized();
  const Vector3 t = 0.5 * transform.translation();
  q.dual = Eigen::Quaterniond(0, t.x(), t.y(), t.z()) * q.real;
  q.stretch = rotation.transpose() * transform.linear();
  return q;
}

}  // namespace detail

inline Points<double> skin(const Points<double>& points, const SkinWeights& weights, const Pose& pose,
                           Skinning method) {
  assert(weights.rows() == points.rows() && weights.cols() == static_cast<Eigen::Index>(pose.size()));
  Points<double> posed(points.rows(), 3);
  if (method == Skinning::linear_blend) {
    for (Eigen::Index v = 0; v < points.rows(); ++v) {
      Eigen::Matrix<double, 3, 4> blended = Eigen::Matrix<double, 3, 4>::Zero();
      bool any = false;
      for (SkinWeights::InnerIterator it(weights, v); it; ++it, any = true)
        blended += it.value() * pose[static_cast<std::size_t>(it.col())].matrix().topRows<3>();
      const Vector3 p = points.row(v).transpose();
      const Vector3 moved = blended.leftCols<3>() * p + blended.col(3);
      posed.row(v) = (any ? moved : p).transpose();
    }
    return posed;
  }
  std::vector<detail::DualQuaternion> motion;
  motion.reserve(pose.size());
  for (const Eigen::Affine3d& transform : pose) motion.push_back(detail::dual_quaternion(transform));
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const detail::DualQuaternion* pivot = nullptr;  // signs are taken relative to the strongest bone
    double strongest = 0;
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      if (it.value() > strongest) strongest = it.value(), pivot = &motion[static_cast<std::size_t>(it.col())];
    const Vector3 p = points.row(v).transpose();
    if (!pivot) {
      posed.row(v) = p.transpose();
      continue;
    }
    Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();
    Eigen::Matrix3d stretch = Eigen::Matrix3d::Zero();
    for (SkinWeights::InnerIterator it(weights, v); it; ++it) {
      const detail::DualQuaternion& q = motion[static_cast<std::size_t>(it.col())];
      const double w = q.real.dot(pivot->real) < 0 ? -it.value() : it.value();
      real += w * q.real.coeffs();
      dual += w * q.dual.coeffs();
      stretch += it.value() * q.stretch;
    }
    const double length = real.norm();  // > 0: every term lies in the pivot's half space, the pivot's own inside it
    const Eigen::Quaterniond r(Eigen::Vector4d(real / length)), d(Eigen::Vector4d(dual / length));
    const Vector3 translation = 2 * (r.w() * d.vec() - d.w() * r.vec() + r.vec().cross(d.vec()));
    posed.row(v) = (r * Vector3(stretch * p) + translation).transpose();
  }
  return posed;
}

inline std::vector<Index> rigid_groups(const Pose& pose) {
  std::vector<Index> group(pose.size());
  std::vector<std::size_t> first;  // a bone of each group
  for (std::size_t b = 0; b < pose.size(); ++b) {
    std::size_t g = 0;
    while (g < first.size() && pose[first[g]].matrix() != pose[b].matrix()) ++g;
    if (g == first.size()) first.push_back(b);
    group[b] = static_cast<Index>(g);
  }
  return group;
}

inline Eigen::VectorXd blending(const SkinWeights& weights, const Pose& pose) {
  const std::vector<Index> group = rigid_groups(pose);
  Eigen::VectorXd result(weights.rows());
  std::vector<double> share(pose.size(), 0);
  for (Eigen::Index v = 0; v < weights.rows(); ++v) {
    double largest = 0;
    for (SkinWeights::InnerIterator it(weights, v); it; ++it) {
      double& s = share[static_cast<std::size_t>(group[static_cast<std::size_t>(it.col())])];
      s += it.value();
      largest = std::max(largest, s);
    }
    for (SkinWeights::InnerIterator it(weights, v); it; ++it)
      share[static_cast<std::size_t>(group[static_cast<std::size_t>(it.col())])] = 0;
    result[v] = 1 - largest;
  }
  return result;
}

}  // namespace quadrig
