// Nodes and skins.
#include "nodes.hpp"

#include <Eigen/Dense>

#include "io/scan.hpp"

namespace quadrig::gltf {
namespace {

/// A matrix whose last row is taken for 0 0 0 1: files have it off by rounding.
Eigen::Affine3d affine(const Eigen::Matrix4d& matrix) {
  Eigen::Affine3d transform;
  transform.matrix() = matrix;
  transform.makeAffine();
  return transform;
}

bool invertible(const Eigen::Affine3d& transform) {
  if (!transform.matrix().allFinite()) return false;
  const double scale = transform.linear().norm();
  return std::abs(transform.linear().determinant()) > 1e-12 * scale * scale * scale;
}

}  // namespace

Eigen::Affine3d NodeTree::local(const Node& node) {
  if (node.matrix) return affine(*node.matrix);
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  const double length = node.rotation.norm();
  const Eigen::Quaterniond q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
  const Eigen::Matrix3d turn = length > 0 ? q.normalized().toRotationMatrix() : Eigen::Matrix3d::Identity();
  transform.linear() = turn * node.scale.asDiagonal();
  transform.translation() = node.translation;
  return transform;
}

std::vector<Eigen::Affine3d> NodeTree::world(std::span<const Node> nodes, std::span<const std::size_t> order) {
  std::vector<Eigen::Affine3d> world(nodes.size(), Eigen::Affine3d::Identity());
  for (const std::size_t i : order) {
    const std::size_t up = nodes[i].parent;
    world[i] = up == Node::no_node ? local(nodes[i]) : world[up] * local(nodes[i]);
  }
  return world;
}

Expected<NodeTree> NodeTree::read(const State& state) {
  const Json& all = array_of(state.json, "nodes");
  NodeTree tree;
  tree.nodes.resize(all.size());
  std::vector<std::vector<std::size_t>> children(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const std::string where = numbered("nodes", i);
    Node& node = tree.nodes[i];
    const auto matrix = number_array(state, all[i], "matrix", 16, where);
    if (!matrix) return matrix.error();
    if (*matrix) node.matrix = Eigen::Map<const Eigen::Matrix4d>((*matrix)->data());
    const auto translation = number_array(state, all[i], "translation", 3, where);
    if (!translation) return translation.error();
    if (*translation) node.translation = Eigen::Map<const Vector3>((*translation)->data());
    const auto rotation = number_array(state, all[i], "rotation", 4, where);
    if (!rotation) return rotation.error();
    if (*rotation) node.rotation = Eigen::Map<const Eigen::Vector4d>((*rotation)->data());
    const auto scale = number_array(state, all[i], "scale", 3, where);
    if (!scale) return scale.error();
    if (*scale) node.scale = Eigen::Map<const Vector3>((*scale)->data());
    for (const Json& child : array_of(all[i], "children")) {
      const auto number = whole(child);
      if (!number || *number >= all.size()) return state.bad(where + ".children", "names a node that is not there");
      if (tree.nodes[*number].parent != Node::no_node) return state.bad(numbered("nodes", *number), "has two parents");
      tree.nodes[*number].parent = i;
      children[i].push_back(*number);
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i)
    if (tree.nodes[i].parent == Node::no_node) tree.order.push_back(i);
  for (std::size_t k = 0; k < tree.order.size(); ++k)
    for (const std::size_t child : children[tree.order[k]]) tree.order.push_back(child);
  if (tree.order.size() != all.size()) return state.bad("nodes", "form a cycle");
  return tree;
}

Expected<Skin> read_skin(State& state, const NodeTree& tree, std::size_t i, Budget& budget) {
  const std::string where = numbered("skins", i);
  const Expected<const Json*> json = entry(state, "skins", i, where);
  if (!json) return json.error();
  Skin skin;
  if (const Json* name = member(**json, "name"); name && name->is_string()) skin.name = name->get<std::string>();
  std::vector<Index> joint_of(tree.nodes.size(), no_index);
  for (const Json& joint : array_of(**json, "joints")) {
    const auto node = whole(joint);
    if (!node || *node >= tree.nodes.size()) return state.bad(where + ".joints", "names a node that is not there");
    if (joint_of[*node] != no_index)
      return state.bad(where + ".joints", "names " + numbered("nodes", *node) + " twice");
    joint_of[*node] = static_cast<Index>(skin.joints.size());
    skin.joints.push_back(*node);
  }
  const std::size_t count = skin.joints.size();
  if (count == 0) return state.bad(where, "has no joints");
  std::vector<Index> above(tree.nodes.size(), no_index);  // the nearest joint above each node
  for (const std::size_t node : tree.order)
    if (const std::size_t up = tree.nodes[node].parent; up != Node::no_node)
      above[node] = joint_of[up] != no_index ? joint_of[up] : above[up];
  for (const std::size_t joint : skin.joints) skin.parent.push_back(above[joint]);
  skin.inverse_bind.assign(count, Eigen::Affine3d::Identity());
  if (member(**json, "inverseBindMatrices")) {
    const Expected<std::size_t> accessor = whole_member(state, **json, "inverseBindMatrices", where);
    if (!accessor) return accessor.error();
    const Expected<AccessorShape> shape = accessor_shape(state, *accessor);
    if (!shape) return shape.error();
    if (shape->components != 16 || shape->count < count)
      return state.bad(where + ".inverseBindMatrices", "are not one matrix a joint");
    const Expected<Values> values = read_accessor(state, *accessor, budget);
    if (!values) return values.error();
    for (std::size_t j = 0; j < count; ++j) {
      const Eigen::Matrix4d matrix =
          Eigen::Map<const Eigen::Matrix4d>(values->row(static_cast<Eigen::Index>(j)).data());
      skin.inverse_bind[j] = affine(matrix);
      if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) ++skin.bind_rows;
    }
  }
  // The first sound joint says how mesh space lies in the scene at rest; where the rest pose is the bind pose, every
  // joint says the same.
  const std::vector<Eigen::Affine3d> world = NodeTree::world(tree.nodes, tree.order);
  std::vector<std::size_t> singular;
  bool placed = false;
  for (std::size_t j = 0; j < count; ++j) {
    if (!invertible(skin.inverse_bind[j])) {
      singular.push_back(j);
      continue;
    }
    const Eigen::Affine3d bound = world[skin.joints[j]] * skin.inverse_bind[j];
    if (placed || !invertible(bound)) continue;
    skin.to_mesh = bound.inverse();
    placed = true;
  }
  for (const std::size_t j : singular) {
    const Eigen::Affine3d there = skin.to_mesh * world[skin.joints[j]];
    skin.inverse_bind[j] = invertible(there) ? there.inverse() : Eigen::Affine3d::Identity();
  }
  skin.singular_binds = static_cast<Index>(singular.size());
  return skin;
}

Skeleton bones_of(const Skin& skin, const TriangleMesh<double>& mesh, const SkinWeights& weights) {
  const std::size_t count = skin.joints.size();
  std::vector<Vector3> head(count);
  for (std::size_t j = 0; j < count; ++j) head[j] = skin.inverse_bind[j].inverse().translation();
  std::vector<std::vector<std::size_t>> children(count);
  for (std::size_t j = 0; j < count; ++j)
    if (skin.parent[j] != no_index) children[at(skin.parent[j])].push_back(j);

  // Σ_v w[v, j] w[v, c] for joints with several children, and the moments of each joint's surface.
  const Eigen::SparseMatrix<double> by_joint = weights;
  std::vector<double> vertex_area(at(mesh.vertex_count()), 0.0);
  for (Index f = 0; f < mesh.face_count(); ++f)
    for (int i = 0; i < 3; ++i) vertex_area[at(mesh.faces()(f, i))] += mesh.area(f) / 3;
  const double least_length = 1e-6 * mesh.diagonal();

  Skeleton skeleton;
  for (std::size_t j = 0; j < count; ++j) {
    Bone bone;
    bone.head = bone.tail = head[j];
    bone.parent = skin.parent[j];
    bone.has_direction = false;
    const auto column = static_cast<Index>(j);
    std::size_t towards = count;
    if (children[j].size() == 1) {
      towards = children[j].front();
    } else if (!children[j].empty()) {
      Eigen::VectorXd own = Eigen::VectorXd::Zero(weights.rows());
      for (Eigen::SparseMatrix<double>::InnerIterator it(by_joint, column); it; ++it) own[it.row()] = it.value();
      double most = -1;
      for (const std::size_t c : children[j]) {
        double shared = 0;
        for (Eigen::SparseMatrix<double>::InnerIterator it(by_joint, static_cast<Index>(c)); it; ++it)
          shared += it.value() * own[it.row()];
        if (shared > most) most = shared, towards = c;
      }
    }
    if (towards < count && (head[towards] - head[j]).norm() > least_length) {
      bone.tail = head[towards];
      bone.has_direction = true;
    } else {
      double mass = 0;
      Vector3 mean = Vector3::Zero();
      Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
      for (Eigen::SparseMatrix<double>::InnerIterator it(by_joint, column); it; ++it) {
        const double m = it.value() * vertex_area[at(static_cast<Index>(it.row()))];
        mass += m;
        mean += m * mesh.position(static_cast<Index>(it.row()));
      }
      if (mass > 0) {
        mean /= mass;
        for (Eigen::SparseMatrix<double>::InnerIterator it(by_joint, column); it; ++it) {
          const Vector3 d = mesh.position(static_cast<Index>(it.row())) - mean;
          square += it.value() * vertex_area[at(static_cast<Index>(it.row()))] / mass * d * d.transpose();
        }
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(square);
        const double largest = axes.eigenvalues()[2], second = axes.eigenvalues()[1];
        if (largest > 1.5 * second && largest > least_length * least_length) {
          Vector3 axis = axes.eigenvectors().col(2);
          if (axis.dot(mean - head[j]) < 0) axis = -axis;
          bone.tail = head[j] + 2 * std::sqrt(largest) * axis;
          bone.has_direction = true;
        }
      }
    }
    skeleton.bones.push_back(std::move(bone));
  }
  return skeleton;
}

}  // namespace quadrig::gltf
