// The node tree, skins, their joints, and what moves them.
#pragma once

#include <Eigen/Geometry>

#include "document.hpp"
#include "quadrig/gltf/surface.hpp"

namespace quadrig::gltf {

struct Node {
  Vector3 translation = Vector3::Zero(), scale = Vector3::Ones();
  Eigen::Vector4d rotation{0, 0, 0, 1};   ///< x y z w
  std::optional<Eigen::Matrix4d> matrix;  ///< instead of the three
  std::size_t parent = no_node;
  static constexpr std::size_t no_node = static_cast<std::size_t>(-1);
};

struct NodeTree {
  std::vector<Node> nodes;
  std::vector<std::size_t> order;  ///< parents first

  [[nodiscard]] static Expected<NodeTree> read(const State& state);
  [[nodiscard]] static Eigen::Affine3d local(const Node& node);
  /// Transforms to the scene of all nodes.
  [[nodiscard]] static std::vector<Eigen::Affine3d> world(std::span<const Node> nodes,
                                                          std::span<const std::size_t> order);
};

struct Skin {
  std::string name;
  std::vector<std::size_t> joints;  ///< nodes
  std::vector<Index> parent;        ///< joint above each, through nodes that are none
  std::vector<Eigen::Affine3d> inverse_bind;
  /// Takes a pose's joint transforms (world · inverse bind) back to the space of the meshes at bind.
  Eigen::Affine3d to_mesh = Eigen::Affine3d::Identity();
  Index singular_binds = 0, bind_rows = 0;  ///< matrices mended: not invertible; last row not 0 0 0 1
};

[[nodiscard]] Expected<Skin> read_skin(State& state, const NodeTree& tree, std::size_t i, Budget& budget);

/// One bone a joint, by the rule of docs/gltf.md.
[[nodiscard]] Skeleton bones_of(const Skin& skin, const TriangleMesh<double>& mesh, const SkinWeights& weights);

/// All clips of the file, sampled. \fails bad_input; unsupported beyond the limit of frames
[[nodiscard]] Expected<std::vector<Clip>> read_clips(State& state, const NodeTree& tree, const Skin& skin,
                                                     double frames_per_second, Budget& budget, Budget& frame_budget);

}  // namespace quadrig::gltf
