// The rigged surfaces of a glTF file.
#pragma once

#include "quadrig/gltf/document.hpp"

namespace quadrig {

/// Counts what a skin's weights and matrices needed before they could be used.
struct GltfRepairs {
  Index bad_weights = 0;     ///< not finite, negative, or of a joint that the skin has not: left out
  Index unweighted = 0;      ///< vertices without any weight: they follow their nearest neighbour on the surface
  Index rescaled = 0;        ///< vertices whose weights did not sum to 1 within 1e-3
  Index singular_binds = 0;  ///< inverse bind matrices that cannot be inverted: the joint stays where its node is
  Index bind_rows = 0;       ///< inverse bind matrices whose last row is not 0 0 0 1: set so
  Index loose_roots = 0;     ///< trees of joints that no root in every scene of the skin holds together: given one
  [[nodiscard]] std::vector<std::string> sentences() const;
};

/// Which primitives become surfaces. Without names: all that a skin moves and those of meshes that hang on joints or,
/// in a file where no skin moves a mesh, all.
struct GltfSelection {
  /// Names, or regular expressions (ECMAScript) of whole names. Chosen is a primitive whose material, mesh or skin, or
  /// a node that has the mesh, is called so; what no skin moves too.
  std::vector<std::string> names;
  bool unskinned = false;  ///< meshes that no skin moves too
};

struct GltfClipOptions {
  double frames_per_second = 30;
  bool enabled = true;
};

/// The surface of one skin: the triangles of all primitives that it moves, in the space its meshes are in, and its
/// rig, one bone a joint. Or that of one mesh that no skin moves, without a rig.
struct GltfSurface {
  Asset asset;
  Index skin = no_index;                ///< no_index: not skinned
  std::string name;                     ///< of the skin or its first mesh
  std::vector<Index> meshes;            ///< of the file
  std::vector<Index> source_primitive;  ///< m, numbers all primitives of `meshes` in order
  std::vector<Index> source_triangle;   ///< m, of that primitive
  PrepareReport prepared;
  GltfRepairs repairs;
  double world_scale = 1;  ///< lengths in the scene's rest pose by lengths in mesh space

  /// "skins[0] 'body'" or "meshes[3] 'crate'".
  [[nodiscard]] std::string label() const;
};

/// Reads the surfaces of a file, those of skins with their rig (bones by docs/gltf.md) and sampled clips.
/// \fails as the document's parts demand; bad_input where there are no triangles; bad_option where a name of the
///   selection is no regular expression or nothing is called so; unsupported, by name, for geometry that an extension
///   compresses and this build does not read
[[nodiscard]] Expected<std::vector<GltfSurface>> gltf_surfaces(const GltfDocument& document,
                                                               const PrepareOptions& prepare,
                                                               const GltfClipOptions& clips, Context& context,
                                                               const GltfSelection& selection = {});

/// One primitive with one attribute, as the file has them.
struct GltfVertices {
  Index mesh = no_index, primitive = no_index;  ///< of the file, of the mesh
  Points<double> positions;                     ///< n×3
  Triangles triangles;                          ///< strips and fans as triangles
  Eigen::MatrixXd values;                       ///< n×k; without rows where the primitive has not this attribute
  Index quads = 0;  ///< that the first triangles are the halves of, in pairs: as remesh_gltf marks them (docs/gltf.md)
};

/// Triangles of all primitives of all meshes, counted by what the JSON announces. \cost O(primitives)
[[nodiscard]] Index gltf_triangle_count(const GltfDocument& document);

/// Every primitive of every mesh, in order, with the attribute `name`: "_SOURCE" reads a source map back,
/// "targets[0].NORMAL" a morph target. Primitives that are no triangles have neither positions nor triangles.
/// \fails bad_input, unsupported as gltf_surfaces
[[nodiscard]] Expected<std::vector<GltfVertices>> gltf_vertices(const GltfDocument& document, std::string_view name,
                                                                Context& context);

/// The triangles of all primitives of all meshes, each mesh in its own space, as polygons: those that are marked as the
/// halves of quads are quads. Vertices at one position are one. \fails as gltf_vertices; bad_input where there are no
/// triangles
[[nodiscard]] Expected<PolygonMesh> gltf_polygons(const GltfDocument& document, Context& context);

}  // namespace quadrig
