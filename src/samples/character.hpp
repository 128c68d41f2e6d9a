// A character as parts, and its file.
#pragma once

#include "quadrig/asset.hpp"

namespace quadrig::samples {

/// One primitive. Rows of a matrix are vertices; matrices that do not apply have none.
struct Part {
  std::size_t material = 0;
  Points<double> positions, normals;
  Triangles faces;
  Eigen::Matrix<double, Eigen::Dynamic, 2> texture;
  Eigen::MatrixXd weights;              ///< a column a joint of the skin
  std::vector<Points<double>> targets;  ///< displacements
  Points<double> roots;                 ///< of sheets that stand off the skin: the points that they move with
};

struct Picture {
  int width = 0, height = 0;
  std::string rgb;  ///< rows from the top
};

struct CharacterMaterial {
  std::string name;
  std::array<double, 4> color{1, 1, 1, 1};
  bool both_sides = false;
  double roughness = 0.6;
  std::optional<Picture> picture = {};
};

struct CharacterMesh {
  std::string name;
  std::vector<Part> parts;
  std::vector<Index> joints;  ///< bones of its skin; one without a skin hangs on `parent`
  Index parent = no_index;
  std::vector<std::string> target_names;
};

/// A turn of a bone about its head: degrees about an axis at each of the times.
struct CharacterTurn {
  Index bone;
  Vector3 axis;
  std::vector<double> seconds, degrees;
};

struct Character {
  std::string name;
  Skeleton skeleton;
  std::vector<CharacterMesh> meshes;
  std::vector<CharacterMaterial> materials;
  std::vector<CharacterTurn> clip;  ///< one clip; turns have the same times
};

/// The character as a binary glTF file.
[[nodiscard]] std::string character_glb(const Character& character);

/// Normals of vertices from their faces, by area.
[[nodiscard]] Points<double> vertex_normals(const Points<double>& positions, const Triangles& faces);

}  // namespace quadrig::samples
