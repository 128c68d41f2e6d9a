// New primitives: vertices and triangles collected by primitive, then put in the place of the old ones.
#pragma once

#include <unordered_map>

#include "gather.hpp"

namespace quadrig::gltf {

/// The new vertices and triangles of one primitive.
class PrimitiveBuilder {
 public:
  struct Vertex {
    Vector3 position, normal;
    Eigen::VectorXd values;                         ///< all columns of Gathered::attributes
    std::vector<std::pair<Index, double>> weights;  ///< strongest first, sum 1; empty without a skin
    Eigen::Vector4d source;                         ///< of the source map
    Eigen::Vector4d tangent = Eigen::Vector4d::Zero();
  };
  /// The number of the vertex that `key` stands for; made where it is new.
  Index vertex(std::uint64_t key, function_ref<Vertex()> make);
  void triangle(Index a, Index b, Index c) { indices_.insert(indices_.end(), {a, b, c}); }
  /// Before all triangles.
  void quad(Index a, Index b, Index c, Index d) {
    triangle(a, b, c);
    triangle(a, c, d);
    ++quads_;
  }
  /// The same of two halves that may have vertices of their own.
  void quad(const std::array<Index, 3>& first, const std::array<Index, 3>& second) {
    triangle(first[0], first[1], first[2]);
    triangle(second[0], second[1], second[2]);
    ++quads_;
  }
  /// Without it no normals are written: as in the file's own triangles that have none, which are drawn flat.
  void needs_normals() { needs_normals_ = true; }
  /// Tangents of all vertices and of morph targets that have some; a vertex with several is made several.
  void make_tangents(const Gathered& gathered, const Primitive& primitive);

  [[nodiscard]] Points<double> positions() const;
  [[nodiscard]] Triangles faces() const;
  /// Three columns of what the vertices carry.
  [[nodiscard]] Points<double> columns(Eigen::Index first) const;
  [[nodiscard]] bool empty() const { return indices_.empty(); }
  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(vertices_.size()); }
  /// Writes accessors and returns the primitive `old` with them in the place of its own.
  [[nodiscard]] Json write(State& state, const Json& old, const Gathered& gathered, const Primitive& primitive,
                           bool source_map) const;

 private:
  std::vector<Vertex> vertices_;
  std::vector<Index> indices_;
  Index quads_ = 0;
  bool needs_normals_ = false;
  std::unordered_map<std::uint64_t, Index> known_;
};

/// One matrix a joint, by columns. \return the accessor
[[nodiscard]] std::size_t append_matrices(State& state, std::span<const Eigen::Affine3d> matrices);

}  // namespace quadrig::gltf
