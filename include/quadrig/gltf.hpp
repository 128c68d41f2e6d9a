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
  /// `strict`: a part that cannot be remeshed is an error.
  PrepareOptions prepare;
  GltfSelection selection;
  /// Called before a part of a surface is remeshed, with its mesh and rig, the face of the surface's mesh that each of
  /// its faces is, and its options: may set what depends on the mesh, such as directions, densities and features.
  std::function<void(const Asset& part, std::span<const Index> source_face, RemeshOptions& options)> on_part;
  GltfPoses pose_source = GltfPoses::bends;
  Index most_poses = 64;  ///< of clips
  /// Shells whose share of the count is smaller are left as the triangles they are.
  double least_shell_quads = 6;
  /// Each vertex tells where it lies on the input, as the attribute _SOURCE (docs/gltf.md).
  bool source_map = false;
  /// Edges between regions of quads go onto the seams of texture coordinates, colours and materials where no quad's
  /// scaled Jacobian falls below `least_at_seams`, or below what it was.
  bool snap_seams = true;
  /// Borders of materials (of primitives), and of texture islands and colours, are features of the remesh: edges of
  /// quads run along them, not only where they happen to lie near.
  bool keep_materials = false, keep_textures = false;
  double least_at_seams = 0.5;
};

/// A part that was to be remeshed, could not be, and stays as the triangles it is.
struct GltfFailure {
  std::string part;  ///< "skins[0] 'body'", or a shell of it: "skins[0] 'body', shell 3 (meshes[1], 120 triangles)"
  Error reason;
};

/// What became of one surface.
struct GltfRemeshed {
  GltfSurface surface;
  RemeshResult result;                            ///< of the shells that were remeshed; `source` refers to `remeshed`
  TriangleMesh<double> remeshed;                  ///< those shells
  Index passed_shells = 0, passed_triangles = 0;  ///< too small, or failed
  std::vector<GltfFailure> failures;
  Index seam_edges = 0, snapped_edges = 0;             ///< of quads, between regions; of those, on a seam
  Index written_vertices = 0, written_primitives = 0;  ///< vertices count once more along seams
};

/// Remeshes the surfaces that `selection` tells and puts the quads in the place of their triangles, each as two
/// triangles that begin with the same vertex. Joints, inverse bind matrices, clips, materials, other meshes and nodes
/// stay as they are. A shell or a surface that cannot be remeshed stays as it is, with its reason.
/// \fails as gltf_surfaces and remesh do where no part at all could be remeshed; at an option that cannot be; when
///   cancelled; under `strict` at the first part that fails. Then the document is unchanged.
[[nodiscard]] Expected<std::vector<GltfRemeshed>> remesh_gltf(GltfDocument& document, const GltfRemeshOptions& options,
                                                              Context& context);

}  // namespace quadrig
