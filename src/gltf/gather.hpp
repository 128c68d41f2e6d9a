// The triangles of one skin, of all its primitives together, with everything their vertices carry.
#pragma once

#include <array>
#include <span>

#include "nodes.hpp"

namespace quadrig::gltf {

/// What the vertices of a primitive carry beside position and weights: columns of one matrix.
struct Attribute {
  std::string name;  ///< TEXCOORD_0, COLOR_0, NORMAL, _custom; or POSITION of a morph target
  std::size_t target = no_target;
  Eigen::Index first = 0, width = 0;
  static constexpr std::size_t no_target = static_cast<std::size_t>(-1);

  /// Regions end where it jumps: neighbours on the other side of a seam have other coordinates or colours.
  [[nodiscard]] bool makes_seams() const {
    return target == no_target && (name.starts_with("TEXCOORD_") || name.starts_with("COLOR_"));
  }
};

struct Primitive {
  std::size_t mesh = 0, number = 0;     ///< of the file, of the mesh
  std::vector<std::size_t> attributes;  ///< of Gathered::attributes, in the file's order
  std::size_t targets = 0;
};

struct Gathered {
  GltfSurface surface;
  std::vector<Primitive> primitives;
  std::vector<Attribute> attributes;
  Values values;        ///< gathered vertices × columns of all attributes; 0 where a primitive has not one
  Triangles triangles;  ///< of gathered vertices
  Points<double> positions;
  std::vector<Index> triangle_primitive, triangle_number;
  std::vector<Eigen::Affine3d> inverse_bind;  ///< of the joints, mended
  std::vector<Index> corner_vertex;           ///< 3m, gathered vertex of each corner of the prepared surface
};

/// \fails as gltf_surfaces
[[nodiscard]] Expected<std::vector<Gathered>> gather(State& state, const PrepareOptions& prepare,
                                                     const GltfClipOptions& clips, Context& context);

/// Joint weights of gathered vertices, mended: rows sum to 1.
struct RawWeights {
  std::vector<std::vector<std::pair<Index, double>>> rows;
};
[[nodiscard]] VertexWeights mend_weights(RawWeights raw, const Triangles& triangles, const Points<double>& positions,
                                         Index joints, GltfRepairs& repairs);

}  // namespace quadrig::gltf
