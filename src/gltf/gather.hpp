// The triangles of one surface, of all its primitives together, with everything their vertices carry.
#pragma once

#include <array>
#include <map>
#include <span>
#include <tuple>

#include "nodes.hpp"
#include "reader.hpp"

namespace quadrig::gltf {

/// What the vertices of a primitive carry beside position and weights: columns of one matrix.
struct Attribute {
  std::string name;  ///< TEXCOORD_0, COLOR_0, NORMAL, _custom; of morph targets POSITION and TANGENT too
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
  std::optional<std::size_t> material;  ///< of the file
  std::vector<std::size_t> attributes;  ///< of Gathered::attributes, in the file's order
  std::size_t targets = 0;
  bool tangents = false;  ///< it has them: they are made anew
  /// Two columns of Gathered::values: the texture coordinates that they follow. no_texture: it has none.
  Eigen::Index texture = no_texture;
  static constexpr Eigen::Index no_texture = -1;
};

struct Gathered {
  GltfSurface surface;
  std::optional<Error> failure;  ///< why there is no surface: then only its label and meshes are told
  std::vector<Primitive> primitives;
  std::vector<Attribute> attributes;
  Values values;        ///< gathered vertices × columns of all attributes; 0 where a primitive has not one
  Triangles triangles;  ///< of gathered vertices
  Points<double> positions;
  std::vector<Index> triangle_primitive, triangle_number;
  std::vector<Eigen::Affine3d> inverse_bind;  ///< of the joints, mended
  std::vector<Index> corner_vertex;           ///< 3m, gathered vertex of each corner of the prepared surface
  std::vector<Index> source_triangle;         ///< m, of `triangles`

  [[nodiscard]] Index joints() const { return static_cast<Index>(inverse_bind.size()); }
};

/// Surfaces one after another; one that cannot be used has its `failure`.
/// \fails where the file as a whole cannot be used, the selection cannot be, all surfaces fail, or when cancelled
[[nodiscard]] Expected<std::vector<Gathered>> gather(State& state, const PrepareOptions& prepare,
                                                     const GltfClipOptions& clips, const GltfSelection& selection,
                                                     Context& context);

/// Joint weights of gathered vertices, mended: rows sum to 1.
struct RawWeights {
  std::vector<std::vector<std::pair<Index, double>>> rows;
};
[[nodiscard]] VertexWeights mend_weights(RawWeights raw, const Triangles& triangles, const Points<double>& positions,
                                         Index joints, GltfRepairs& repairs);

/// Reads the primitives of one surface one after another.
class Gatherer {
 public:
  /// `joints`: 0 where the surface is not skinned.
  Gatherer(State& state, Gathered& out, Index joints, Budget& budget, Cache& cache)
      : state_(state), out_(out), joints_(joints), budget_(budget), cache_(cache) {}

  /// A primitive that is no surface, or has joints where there are none, is passed over.
  [[nodiscard]] Status add(std::size_t mesh, std::size_t number, const Json& json);
  [[nodiscard]] Status finish();
  RawWeights weights;
  bool lost_tangents = false;  ///< a primitive has some, but no texture coordinates to make new ones from

 private:
  struct Loose {
    std::size_t attribute;
    std::shared_ptr<const Values> values;
  };
  [[nodiscard]] Eigen::Index texture_of_normals(const Json& primitive, const Primitive& made) const;
  [[nodiscard]] Status morphs(const PrimitiveReader& reader, const Json& targets, const std::string& where,
                              Primitive& primitive, std::vector<Loose>& loose);
  [[nodiscard]] std::size_t column(const std::string& name, std::size_t target, Eigen::Index width);

  State& state_;
  Gathered& out_;
  Index joints_;
  Budget& budget_;
  Cache& cache_;
  std::vector<Vector3> positions_;
  std::vector<std::array<Index, 3>> triangles_;
  std::vector<std::vector<double>> rows_;  // values of each vertex: as many columns as were known when it was added
  std::map<std::tuple<std::string, std::size_t, Eigen::Index>, std::size_t> columns_;
};

}  // namespace quadrig::gltf
