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
  [[nodiscard]] std::vector<std::string> sentences() const;
};

struct GltfClipOptions {
  double frames_per_second = 30;
  bool enabled = true;
};

/// The surface of one skin: the triangles of all primitives that it moves, in the space its meshes are in, and its
/// rig, one bone a joint.
struct GltfSurface {
  Asset asset;
  Index skin = no_index;
  std::string name;                     ///< of the skin or its first mesh
  std::vector<Index> meshes;            ///< of the file
  std::vector<Index> source_primitive;  ///< m, numbers all primitives of `meshes` in order
  std::vector<Index> source_triangle;   ///< m, of that primitive
  PrepareReport prepared;
  GltfRepairs repairs;
  double world_scale = 1;  ///< lengths in the scene's rest pose by lengths in mesh space
};

/// Reads the surface of every skin that moves triangles, with its rig (bones by docs/gltf.md) and sampled clips.
/// \fails as the document's parts demand; bad_input where no skin moves triangles; unsupported, by name, for geometry
///   that an extension compresses
[[nodiscard]] Expected<std::vector<GltfSurface>> gltf_surfaces(const GltfDocument& document,
                                                               const PrepareOptions& prepare,
                                                               const GltfClipOptions& clips, Context& context);

}  // namespace quadrig
