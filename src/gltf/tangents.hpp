// Tangents of new primitives by MikkTSpace, as glTF asks for them (M. Mikkelsen, "Simulation of Wrinkled Surfaces
// Revisited", 2008, and the definition published with it).
#pragma once

#include <span>
#include <vector>

#include "quadrig/core.hpp"

namespace quadrig::gltf {

/// Corners that share a tangent: at the same position, normal and texture coordinates, joined by edges, and with the
/// texture turned the same way.
class TangentGroups {
 public:
  struct Vertices {
    std::span<const Vector3> positions, normals;  ///< normals of length 1
    std::span<const Eigen::Vector2d> texture;
  };
  /// `corners`: three a triangle; the first `quads` pairs of triangles are quads that share their first vertex, and
  /// stay so: both triangles of one are turned the same way. \cost O(m log m)
  TangentGroups(const Vertices& vertices, std::span<const Index> corners, Index quads);

  [[nodiscard]] Index of_corner(std::size_t corner) const { return group_[corner]; }
  /// The sign of the bitangent, ±1: it is w · normal × tangent. In glTF the texture's second coordinate runs down.
  [[nodiscard]] double sign(Index group) const { return sign_[static_cast<std::size_t>(group)]; }
  /// One unit vector a group, orthogonal to its normal; at other positions too, such as those of a morph target.
  [[nodiscard]] std::vector<Vector3> directions(const Vertices& vertices) const;

 private:
  void weld(const Vertices& vertices);
  void turn_quads(const Vertices& vertices, Index quads);
  void grow(std::size_t corner, Index group, const std::vector<Index>& twin);

  std::span<const Index> corners_;
  std::vector<Index> welded_;        // a corner
  std::vector<Index> group_;         // a corner
  std::vector<char> preserving_;     // a triangle: the texture is turned as the triangle is
  std::vector<char> flat_;           // a triangle: it has no area in the texture, and takes what its neighbours have
  std::vector<Index> quad_partner_;  // a triangle
  std::vector<double> sign_;         // a group
};

}  // namespace quadrig::gltf
