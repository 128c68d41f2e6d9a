// Shells of surfaces: what each is, how many triangles it is due, and what it becomes.
#pragma once

#include <map>
#include <optional>

#include "measure.hpp"
#include "quadrig/gltf.hpp"

namespace quadrig::gltf {

/// Quads of a field, with the faces of the surface that they were made on.
struct FieldQuads {
  RemeshResult result;  ///< `source` refers to `faces`
  std::vector<Index> faces;
  std::vector<Index> primitive = {};   ///< of each quad; empty: there is one
  std::map<Index, Index> claims = {};  ///< quads of primitives that would have none, with a face: see Regions
  Index seam_edges = 0, snapped_edges = 0;
};

struct Shell {
  std::vector<Index> faces;  ///< of the surface
  double demand = 0;         ///< of triangles, relative to that of others in the file
  double due = 0;            ///< triangles, a quad counted as two
  bool alone = false;        ///< no shell of the file is due enough for a field, this gets one
  bool bends = false;
  // What it became: polygons of its own vertices, or quads of a field.
  std::vector<Polygon> polygons;
  std::optional<FieldQuads> field;
  /// How far vertices of the surface were moved to keep to their side of what lies below: at rest, and so much more in
  /// each morph target.
  std::map<Index, std::vector<Vector3>> moved;
  GltfMake make = GltfMake::kept;
  Apart apart;
  std::optional<Error> failure;  ///< of the field, where it was to be one and is none

  [[nodiscard]] Index own() const { return static_cast<Index>(faces.size()); }
  [[nodiscard]] double area(const TriangleMesh<double>& surface) const {
    double sum = 0;
    for (const Index f : faces) sum += surface.area(f);
    return sum;
  }
  /// Triangles that it became.
  [[nodiscard]] Index triangles() const {
    return field ? 2 * field->result.mesh.quad_count() : triangle_count(polygons);
  }
};

/// The shells of one surface.
struct Shells {
  Components components;
  std::optional<Wedges> wedges;
  std::vector<Shell> list;
  std::vector<Pose> poses;  ///< that its surface is judged in
  /// Found on the whole surface, for all of its shells; none: there is none, or none was asked for.
  std::optional<MirrorPlane> mirror;
  std::vector<double> density;  ///< factors by hand, one a face; empty: none
};

/// Displacements of a part's vertices by each morph target that moves positions, in the order of the attributes.
/// \param faces of the surface, of which `part` is made
[[nodiscard]] std::vector<Points<double>> morphs_of(const Gathered& gathered, const TriangleMesh<double>& part,
                                                    std::span<const Index> faces);

/// Cuts a surface into shells and finds what each demands: the integral of the cube root of the error that quads of one
/// size would leave, by the posed curvature metric.
/// \fails as the metric does; cancelled
[[nodiscard]] Expected<Shells> find_shells(const Gathered& gathered, const GltfRemeshOptions& options,
                                           Context& context);

/// Factors of the density by hand, one a face; empty where there are none.
[[nodiscard]] std::vector<double> density_factors(const Gathered& gathered, const std::optional<MirrorPlane>& mirror,
                                                  const GltfRemeshOptions& options);
/// \fails bad_option where a name is that of no joint or material
[[nodiscard]] Status check_density(const std::vector<Gathered>& all, const GltfRemeshOptions& options);

/// Shares `triangles` out to all shells by demand, with one multiplier. Those that would get as many as they have, or
/// more, keep what they have unless there are enough for all to have more.
void share_out(std::vector<Shells>& all, double triangles, const GltfRemeshOptions& options);

/// Shells that the plane takes to each other become one where both are due enough for a field: they get the same quads.
void join_twins(const Gathered& gathered, Shells& shells, const GltfRemeshOptions& options, const Context& context);

/// Whether what a shell is due is enough for a field to be laid on it.
[[nodiscard]] bool wants_field(const Shell& shell, const GltfRemeshOptions& options);
/// Whether it is due as many triangles as it has, or nearly: then it keeps them where candidates compete.
[[nodiscard]] bool due_its_own(const Shell& shell);

/// Makes the candidates for a shell, holds each against the shell and keeps the best.
/// \fails bad_option, cancelled; under strict as remesh
[[nodiscard]] Status make_shell(const Gathered& gathered, const Shells& shells, Shell& shell,
                                const GltfRemeshOptions& options, Context& context);

/// "skins[0] 'body', shell 3 (meshes[1], 120 triangles)"
[[nodiscard]] std::string shell_label(const Gathered& gathered, const Shells& shells, const Shell& shell);

}  // namespace quadrig::gltf
