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

/// What the quads of a shell are made of.
enum class GltfTopology : std::uint8_t {
  /// Whatever lies nearest at the same count: quads of a field, the input's own with rows less, or, of shells that are
  /// rigid or too small for a field, simplified triangles in pairs. What is due as many as it has keeps its own.
  best,
  field,  ///< quads of a field wherever a shell is due `least_shell_quads`; smaller ones stay
};

/// Where the normals of new vertices come from. They part where the file's do.
enum class GltfNormals : std::uint8_t {
  automatic,  ///< carried over on shells whose normals are not those of their faces; else new
  keep,       ///< the file's, carried over
  fresh,      ///< those of the new faces
};

struct GltfRemeshOptions {
  /// `quads` counts the quads of all surfaces together, a triangle that is left as half of one; `poses` is set by
  /// `pose_source`.
  RemeshOptions remesh;
  GltfTopology topology = GltfTopology::best;
  /// `strict`: a part that cannot be remeshed is an error.
  PrepareOptions prepare;
  GltfSelection selection;
  /// Called before a part of a surface is remeshed, with its mesh and rig, the face of the surface's mesh that each of
  /// its faces is, and its options: may set what depends on the mesh, such as directions, densities and features.
  std::function<void(const Asset& part, std::span<const Index> source_face, RemeshOptions& options)> on_part;
  /// Density by hand: of what these joints move, of these materials, and of the colours of vertices
  /// (density_of_color). An attribute `_DENSITY` of vertices is one of these factors too, unasked for.
  std::vector<NamedFactor> bone_density, material_density;
  bool density_colors = false;
  GltfPoses pose_source = GltfPoses::bends;
  /// Directions from bones in the poses of the file's clips, averaged, instead of at rest
  /// (DirectionOptions::bone_poses).
  bool clip_directions = false;
  Index most_poses = 64;  ///< of clips
  /// Shells that are due fewer quads are given no field.
  double least_shell_quads = 6;
  /// The same where other candidates compete.
  double least_field_quads = 100;
  /// Shells that bend and are due as many get no simplified triangles in pairs.
  double least_bending_quads = 300;
  /// Each vertex tells where it lies on the input, as the attribute _SOURCE (docs/gltf.md).
  bool source_map = false;
  /// Edges between regions of quads go onto the seams of texture coordinates, colours and materials where no quad's
  /// scaled Jacobian falls below `least_at_seams`, or below what it was.
  bool snap_seams = true;
  /// Borders of materials (of primitives), and of texture islands and colours, are features of the remesh: edges of
  /// quads run along them, not only where they happen to lie near.
  bool keep_materials = false, keep_textures = false;
  double least_at_seams = 0.5;
  GltfNormals normals = GltfNormals::automatic;
  /// A shell that strays farther than this many of its quads' edges is told as a warning; 0: none is.
  double most_edges_off = 2;
};

/// A part that was to be remeshed, could not be, and stays as the triangles it is.
struct GltfFailure {
  std::string part;  ///< "skins[0] 'body'", or a shell of it: "skins[0] 'body', shell 3 (meshes[1], 120 triangles)"
  Error reason;
};

/// How a shell was made.
enum class GltfMake : std::uint8_t {
  kept,        ///< its triangles as they were, in pairs where they make quads
  rows,        ///< its own quads, some rows and quads fewer
  simplified,  ///< edges collapsed, what is left in pairs
  field,       ///< quads of a field
};
[[nodiscard]] constexpr std::string_view gltf_make_name(GltfMake make) {
  constexpr std::array<std::string_view, 4> names{"kept", "rows", "simplified", "field"};
  return names[static_cast<std::size_t>(make)];
}

/// One shell: what it was, what it became, and how far that is from it, in units of its mesh.
struct GltfShell {
  std::string part;  ///< "skins[0] 'body', shell 3 (meshes[1], 120 triangles)"
  GltfMake make = GltfMake::kept;
  Index input_triangles = 0;
  double due = 0;                         ///< triangles
  Index quads = 0, triangles = 0;         ///< triangles: those in no quad
  double edge = 0;                        ///< of its new quads, about: the square root of two triangles' area
  double rms = 0, mean = 0, largest = 0;  ///< two-sided distance, at rest and posed
  double largest_unbent = 0;              ///< at rest and with morph targets
};

/// Both ways, in units of the mesh; the largest at vertices and samples.
struct GltfDistance {
  double mean = 0, largest = 0;
};
/// How far a primitive's new triangles are from its old ones.
struct GltfPrimitive {
  struct Target {
    Index target;
    std::string name;  ///< empty where the file gives none
    GltfDistance distance;
  };
  Index mesh = no_index, primitive = no_index;  ///< of the file, of the mesh
  Index input_triangles = 0, triangles = 0;
  double edge = 0;  ///< of its new quads, about
  double size = 0;  ///< the diagonal of its box
  GltfDistance rest = {};
  std::vector<Target> targets = {};  ///< morph targets that move it
};

/// What became of one surface.
struct GltfRemeshed {
  GltfSurface surface;
  RemeshResult result;            ///< its quads; `source` refers to `remeshed`
  TriangleMesh<double> remeshed;  ///< the shells that have some
  std::vector<GltfShell> shells;
  std::vector<GltfPrimitive> primitives;          ///< that are written anew
  Index triangles = 0;                            ///< that are in no quad
  Index kept_normals = 0;                         ///< shells whose normals were carried over
  Index moved_vertices = 0;                       ///< of sheets over other shells, to stay on their side
  Index strayed = 0;                              ///< shells beyond `most_edges_off`
  Index passed_shells = 0, passed_triangles = 0;  ///< without a quad
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
