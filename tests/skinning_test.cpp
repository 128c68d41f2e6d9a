#include "quadrig/skinning.hpp"

#include "test.hpp"

using namespace quadrig;

namespace {

// shoulder 0 → arm 1 → hand 3, and a second branch 2 from the shoulder's tail
Skeleton branched() {
  Skeleton skeleton;
  skeleton.bones = {{.head = {0, 0, 0}, .tail = {1, 0, 0}},
                    {.head = {1, 0, 0}, .tail = {2, 0.5, 0}, .parent = 0},
                    {.head = {1, 0, 0}, .tail = {1, -1, 0.2}, .parent = 0},
                    {.head = {2, 0.5, 0}, .tail = {2, 1, 3}, .parent = 1}};
  return skeleton;
}

SkinWeights dense(const Eigen::MatrixXd& w) {
  SkinWeights weights(static_cast<Index>(w.rows()), static_cast<Index>(w.cols()));
  for (Index v = 0; v < w.rows(); ++v)
    for (Index b = 0; b < w.cols(); ++b)
      if (w(v, b) != 0) weights.insert(v, b) = w(v, b);
  weights.makeCompressed();
  return weights;
}

Eigen::Affine3d motion(double radians, const Vector3& axis, const Vector3& shift) {
  Eigen::Affine3d m = Eigen::Affine3d::Identity();
  m.linear() = Eigen::AngleAxisd(radians, axis.normalized()).toRotationMatrix();
  m.translation() = shift;
  return m;
}

}  // namespace

TEST_CASE("skinning: a bend turns the bone and all below it about its head, and nothing else", "[skinning][fast]") {
  const Skeleton skeleton = branched();
  CHECK(bones_below(skeleton, 0) == std::vector<Index>{0, 1, 2, 3});
  CHECK(bones_below(skeleton, 1) == std::vector<Index>{1, 3});
  CHECK(bones_below(skeleton, 3) == std::vector<Index>{3});
  const Pose pose = bend(skeleton, 1, {0, 0, 5}, std::numbers::pi / 2);
  CHECK(pose[0].matrix() == Eigen::Matrix4d::Identity());
  CHECK(pose[2].matrix() == Eigen::Matrix4d::Identity());
  CHECK((pose[1] * skeleton.bones[1].head - skeleton.bones[1].head).norm() < 1e-15);
  CHECK((pose[3] * Vector3(2, 0, 0) - Vector3(1, 1, 0)).norm() < 1e-15);
  CHECK(rigid_groups(pose) == std::vector<Index>{0, 1, 0, 1});
}

TEST_CASE("skinning: a ring of parents is followed once", "[skinning][fast]") {
  Skeleton skeleton;
  skeleton.bones = {
      {.tail = {1, 0, 0}, .parent = 1}, {.head = {1, 0, 0}, .parent = 0}, {.tail = {0, 1, 0}, .parent = 2}};
  CHECK(bones_below(skeleton, 0) == std::vector<Index>{0, 1});
  CHECK(bones_below(skeleton, 2) == std::vector<Index>{2});
}

TEST_CASE("skinning: each bone bends both ways about two axes across it", "[skinning][fast]") {
  const Skeleton skeleton = branched();
  const std::vector<Pose> poses = bend_poses(skeleton, 60);
  REQUIRE(poses.size() == 16);
  for (std::size_t b = 0; b < 4; ++b) {
    Vector3 axes[4];
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::AngleAxisd turn(Eigen::Matrix3d(poses[4 * b + k][b].linear()));
      CHECK(turn.angle() == Approx(std::numbers::pi / 3));
      CHECK(std::abs(turn.axis().dot(skeleton.bones[b].direction())) < 1e-12);
      axes[k] = turn.axis();
    }
    CHECK((axes[0] + axes[1]).norm() < 1e-12);
    CHECK((axes[2] + axes[3]).norm() < 1e-12);
    CHECK(std::abs(axes[0].dot(axes[2])) < 1e-12);
  }
  // d × z for a bone along x is −y, so the first pose turns by −60° about −y
  CHECK((poses[0][0] * Vector3(1, 0, 0) - Vector3(0.5, 0, -std::sqrt(3.0) / 2)).norm() < 1e-12);
}

TEST_CASE("skinning: the bends of a surface are those of all bones, without the ones that leave it as it is",
          "[skinning][fast]") {
  // 0 - 1 - 2 - 3, 1 - 4, 0 - 5; 2 and 5 carry weight, or 2, 3 and 4: what is above and below them does not.
  Skeleton skeleton;
  for (const Index parent : {no_index, 0, 1, 2, 1, 0}) {
    Bone bone;
    bone.parent = parent;
    bone.head = Vector3(0.1 * skeleton.bone_count(), 1, 0);
    bone.tail = bone.head + Vector3(1, 0.3 * skeleton.bone_count(), 0.2);
    skeleton.bones.push_back(bone);
  }
  const Points<double> points = Points<double>::Random(40, 3);
  for (const std::vector<Index>& used : {std::vector<Index>{2, 5}, {2, 3, 4}, {1}, {0, 1, 2, 3, 4, 5}}) {
    SkinWeights weights(40, 6);
    for (Index v = 0; v < 40; ++v)
      for (const Index b : used) weights.insert(v, b) = 1.0 / static_cast<double>(used.size());
    const SurfaceBends bends = surface_bends(skeleton, weights);
    CHECK(bends.weights.cols() == static_cast<Index>(used.size()));
    CHECK(bends.left_out == 0);
    std::size_t next = 0;
    Index still = 0;
    for (const Pose& pose : bend_poses(skeleton)) {
      bool moves = false, rests = false;
      for (const Index b : used) {
        const bool own = pose[static_cast<std::size_t>(b)].matrix() != Eigen::Matrix4d::Identity();
        (own ? moves : rests) = true;
      }
      if (!moves || !rests) {
        ++still;
        continue;
      }
      REQUIRE(next < bends.poses.size());
      CHECK(skin(points, bends.weights, bends.poses[next]) == skin(points, weights, pose));
      ++next;
    }
    CHECK(next == bends.poses.size());
    CHECK(still == bends.still);
  }
  SkinWeights all(1, 6);
  for (Index b = 0; b < 6; ++b) all.insert(0, b) = (1 + b) / 21.0;
  const SurfaceBends few = surface_bends(skeleton, all, 60, 2 * 4 * 6);  // two bones, those with most weight
  CHECK(few.poses.size() == 8);
  CHECK(few.left_out == 3);  // 0 carries the surface along whole
  CHECK(few.poses.front()[4].matrix() != Eigen::Matrix4d::Identity());
  CHECK(few.poses.back()[5].matrix() != Eigen::Matrix4d::Identity());
}

TEST_CASE("skinning: a chain of many bones bends in little time and memory", "[skinning][fast]") {
  constexpr Index count = 100'000;
  Skeleton skeleton;
  for (Index b = 0; b < count; ++b) {
    Bone bone;
    bone.parent = b - 1;
    bone.tail = Vector3(1, 0, 0);
    skeleton.bones.push_back(bone);
  }
  CHECK(bones_below(skeleton, 10).size() == count - 10);
  SkinWeights weights(2, count);
  weights.insert(0, 3) = weights.insert(1, count - 1) = 1;
  const SurfaceBends bends = surface_bends(skeleton, weights, 60, 1000);
  CHECK(bends.poses.size() == 500);
  CHECK(bends.left_out == count - 4 - 125);
}

TEST_CASE("skinning: points that one bone holds move with it by either method", "[skinning][fast]") {
  Points<double> points(3, 3);
  points << 1, 2, 3, -1, 0.5, 0, 0, 0, 1;
  Eigen::MatrixXd w(3, 2);
  w << 1, 0, 0, 1, 0.3, 0.7;
  const SkinWeights weights = dense(w);
  const Eigen::Affine3d same = motion(2.0, {1, 2, 3}, {4, 5, 6});
  for (const Skinning method : {Skinning::linear_blend, Skinning::dual_quaternion}) {
    const Points<double> together = skin(points, weights, {same, same}, method);
    for (Index v = 0; v < 3; ++v)
      CHECK((together.row(v).transpose() - same * Vector3(points.row(v).transpose())).norm() < 1e-13);
    Eigen::Affine3d stretched = motion(-1.0, {0, 1, 0}, {0, 0, 1});
    stretched.linear() *= Eigen::Vector3d(2, 1, 0.5).asDiagonal();
    const Points<double> apart = skin(points, weights, {same, stretched}, method);
    CHECK((apart.row(0).transpose() - same * Vector3(points.row(0).transpose())).norm() < 1e-13);
    CHECK((apart.row(1).transpose() - stretched * Vector3(points.row(1).transpose())).norm() < 1e-13);
  }
}

TEST_CASE("skinning: dual quaternions keep the distance to the hinge where linear blending loses it",
          "[skinning][fast]") {
  Points<double> points(1, 3);
  points << 0, 1, 0;
  Eigen::MatrixXd w(1, 2);
  w << 0.5, 0.5;
  const Pose pose{Eigen::Affine3d::Identity(), motion(2.0, {0, 0, 1}, Vector3::Zero())};
  const Points<double> linear = skin(points, dense(w), pose),
                       dual = skin(points, dense(w), pose, Skinning::dual_quaternion);
  CHECK(linear.row(0).norm() == Approx(std::cos(1.0)));
  CHECK(dual.row(0).norm() == Approx(1.0));
  CHECK((dual.row(0).transpose() - motion(1.0, {0, 0, 1}, Vector3::Zero()) * Vector3(0, 1, 0)).norm() < 1e-13);
}

TEST_CASE("skinning: dual quaternions blend the short way when two turns have opposite signs", "[skinning][fast]") {
  Points<double> points(1, 3);
  points << 1, 0, 0;
  Eigen::MatrixXd w(1, 2);
  w << 0.5, 0.5;
  const Pose pose{motion(3.0, {0, 0, 1}, Vector3::Zero()), motion(-3.0, {0, 0, 1}, Vector3::Zero())};
  const Points<double> posed = skin(points, dense(w), pose, Skinning::dual_quaternion);
  CHECK((posed.row(0).transpose() - Vector3(-1, 0, 0)).norm() < 1e-13);
}

TEST_CASE("skinning: blending is what the strongest body does not hold", "[skinning][fast]") {
  Eigen::MatrixXd w(3, 3);
  w << 0.2, 0.3, 0.5, 1, 0, 0, 0.4, 0.6, 0;
  const Eigen::Affine3d still = Eigen::Affine3d::Identity(), moved = motion(1, {0, 0, 1}, Vector3::Zero());
  const Eigen::VectorXd b = blending(dense(w), {still, still, moved});
  CHECK(b[0] == Approx(0.5));
  CHECK(b[1] == 0);
  CHECK(b[2] == Approx(0).margin(1e-15));
  CHECK(blending(dense(w), {still, moved, still})[2] == Approx(0.4));
}

TEST_CASE("skinning: clips give their first frames and an even share when there are too many", "[skinning][fast]") {
  std::vector<Clip> clips(2);
  for (int k = 0; k < 30; ++k) clips[0].poses.push_back({motion(0, {0, 0, 1}, {double(k), 0, 0})});
  for (int k = 0; k < 10; ++k) clips[1].poses.push_back({motion(0, {0, 0, 1}, {100.0 + k, 0, 0})});
  CHECK(clip_poses(clips, 100).size() == 40);
  const std::vector<Pose> few = clip_poses(clips, 8);
  REQUIRE(few.size() == 8);
  CHECK(few[0][0].translation().x() == 0);
  CHECK(few[1][0].translation().x() == 5);
  CHECK(few[6][0].translation().x() == 100);
}
