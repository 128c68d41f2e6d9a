// glTF 2.0 files: the lossless document, the rigged surfaces in it, and their remesh. Part of quadrig::io.
#pragma once

#include "quadrig/gltf/surface.hpp"
#include "quadrig/pipeline.hpp"

namespace quadrig {

/// Which poses sizes and directions are made for.
enum class GltfPoses : std::uint8_t {
  bends,  ///< every joint bent
  clips,  ///< the file's own clips, where it has any; else bends
};

struct GltfRemeshOptions {
  /// `quads` counts the quads of all skins together, `poses` is set by `pose_source`.
  RemeshOptions remesh;
  PrepareOptions prepare;
  GltfPoses pose_source = GltfPoses::bends;
  Index most_poses = 64;  ///< of clips
  /// Shells whose share of the count is smaller are left as the triangles they are.
  double least_shell_quads = 6;
};

/// What became of one skin's surface.
struct GltfRemeshed {
  GltfSurface surface;
  RemeshResult result;            ///< of the shells that were remeshed; `source` refers to `remeshed`
  TriangleMesh<double> remeshed;  ///< those shells
  Index passed_shells = 0, passed_triangles = 0;
  Index written_vertices = 0, written_primitives = 0;  ///< vertices count once more along seams
};

/// Remeshes every skinned surface of the document and puts the quads in the place of its triangles, each as two
/// triangles that begin with the same vertex. Joints, inverse bind matrices, clips, materials, other meshes and nodes
/// stay as they are.
/// \fails as gltf_surfaces and remesh do; then the document is unchanged
[[nodiscard]] Expected<std::vector<GltfRemeshed>> remesh_gltf(GltfDocument& document, const GltfRemeshOptions& options,
                                                              Context& context);

}  // namespace quadrig
