// The whole way: a rigged triangle mesh in, quads that follow the rig out, with a report of every stage.
#pragma once

#include <functional>
#include <numbers>

#include "quadrig/asset.hpp"
#include "quadrig/density.hpp"
#include "quadrig/field.hpp"
#include "quadrig/fit.hpp"
#include "quadrig/polish.hpp"
#include "quadrig/quality/hinges.hpp"
#include "quadrig/rims.hpp"
#include "quadrig/seamless/strain.hpp"
#include "quadrig/sizing.hpp"
#include "quadrig/symmetry.hpp"
#include "quadrig/transfer.hpp"

namespace quadrig {

/// A direction along or across which the quads run on a face of the asset's mesh.
struct FaceDirection {
  Index face = no_index;
  Vector3 direction = Vector3::Zero();  ///< its part in the plane of the face counts, its length does not
  double weight = 1;                    ///< against smoothness; that of a bone is 1. Infinity: exactly so
};

/// Terms of the caller's own in the energies of x0 and x1, one unknown a face.
struct OwnTerms {
  std::vector<AnyTerm<Complex>> x0, x1;
};

/// Where the directions of the quads come from, besides smoothness. The thesis preset rejects own directions.
struct DirectionOptions {
  std::optional<double> bones;      ///< pull of the bones; unset: the preset's
  std::optional<double> curvature;  ///< pull of the rest curvature; unset: the preset's
  double posed = 0;                 ///< pull of the posed curvature metric
  std::vector<Pose> bone_poses;     ///< in which bones give directions, averaged; empty: at rest
  /// Directions on some faces, or, as `face_directions` makes them of a field, on all.
  std::vector<FaceDirection> own;
  /// Asked for terms on each triangulation that a field is designed on, from any thread: the mesh, its connection, and
  /// of each face the face of the asset's mesh that it is part of or stands for. Has to give the same whenever asked.
  std::function<OwnTerms(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                         std::span<const Index> parent)>
      terms;
};

/// The directions of a field on its mesh, exactly so: what makes `remesh` follow a field of one's own.
[[nodiscard]] inline std::vector<FaceDirection> face_directions(
    const Connection<double>& connection, const FrameField& frames,
    double weight = std::numeric_limits<double>::infinity()) {
  std::vector<FaceDirection> directions;
  for (Index f = 0; f < frames.face_count(); ++f) {
    const Complex u = frames.u[detail::at(f)], v = frames.v[detail::at(f)];
    // An arm of the cross that the two vectors bisect.
    directions.push_back(
        {f, connection.to_vector(f, elementary::polar(1.0, bisector_angle(u, v) - std::numbers::pi / 4)), weight});
  }
  return directions;
}

/// A curve that quads are to follow, drawn on a surface or near it.
struct Guide {
  std::vector<Vector3> points;  ///< of a polyline, two or more
  bool closed = false;
  double width = 0;   ///< 0: edges of quads run along it; else the length within which it pulls at the directions
  double weight = 1;  ///< of that pull, against smoothness; that of a bone is 1
};

/// How many closed rings of quads there are to be round each joint that bends a limb; docs/map.md.
struct LoopOptions {
  Index least = 3;  ///< at a joint, where the count allows; 0: none are asked for
  /// Other numbers for some joints: a name, in which * stands for anything. The last that matches counts.
  struct OfJoint {
    std::string name;
    Index loops = 0;
  };
  std::vector<OfJoint> of_joints{};

  [[nodiscard]] Index of(std::string_view joint) const {
    Index wanted = least;
    for (const OfJoint& one : of_joints)
      if (matches(joint, one.name)) wanted = one.loops;
    return wanted;
  }
  /// Whether a name fits a pattern.
  [[nodiscard]] static bool matches(std::string_view name, std::string_view pattern) {
    const std::size_t star = pattern.find('*');
    if (star == std::string_view::npos) return name == pattern;
    if (!name.starts_with(pattern.substr(0, star))) return false;
    for (std::size_t k = star; k <= name.size(); ++k)
      if (matches(name.substr(k), pattern.substr(star + 1))) return true;
    return false;
  }
};

/// Closed rings of quads round eyes, mouth and other openings; docs/map.md.
struct RimOptions {
  Index rings = 3;  ///< at a rim, the rim among them
  /// The kinds that get rings where they are found. Unset: eyes and mouth, of assets with a rig; empty: none.
  std::optional<std::vector<RimKind>> kinds{};
  std::vector<Rim> own{};  ///< instead of those that would be found
  /// What the density about eyes and mouth is multiplied by, from 1/64 to 64; the count stays.
  double face_density = 1;
};

struct RemeshOptions {
  Index quads = 2000;  ///< wanted; see RemeshReport::minimum_count for surfaces that need more
  FieldPreset preset = FieldPreset::standard;
  DirectionOptions directions;
  /// Unset: the preset's (docs/bending.md).
  std::optional<SizingOptions> sizing;
  /// What the density that sizes ask for is multiplied by: one a vertex or one a face of the asset's mesh, from 1/64 to
  /// 64; empty: 1. The count stays. Of a body that is mirrored those on the plane's side count.
  std::vector<double> density_factors;
  /// The same by bone, on what each moves; of a mirrored body both of a pair of bones count.
  std::vector<double> bone_density;
  /// Poses the metric is built from, and their weights (empty: 1 each). No poses: every bone bent by ±`bend_degrees`
  /// about two axes.
  std::vector<Pose> poses;
  std::vector<double> pose_weights;
  double bend_degrees = 60;
  /// Displacements of the asset's vertices by morph targets, n×3 each: poses of the fit, carried over to the quads.
  std::vector<Points<double>> morphs;
  double count_tolerance = 0.05;
  Index influences = 4;  ///< most skin weights a vertex of the quads keeps
  /// Edges that bend more than this become edges of quads, radians, where they run on; π: none. Unset: those of
  /// components made of flat sides (docs/command.md), where there is no rig.
  std::optional<double> crease_angle_radians;
  /// Half-edges of the asset's mesh, one of a pair is enough, that become edges of quads: borders of materials or
  /// texture islands (`label_borders`), whatever the caller wants to find again.
  std::vector<Index> features;
  /// Curves within 3 % of the diagonal of the surface. The surface is cut along those that become edges.
  std::vector<Guide> guides;
  /// Where another vertex group gets the largest weight, the border becomes edges of quads too.
  bool group_borders = false;
  /// The same topology on both sides of a mirror plane, with a chain of edges on it. Unset: `automatic` where the asset
  /// has a rig and the preset is not the thesis's, else `none`.
  std::optional<SymmetryChoice> symmetry;
  /// The plane, where the caller knows it: none is looked for.
  std::optional<MirrorPlane> mirror_plane;
  /// Rounds of `reduce_curl` on directions and sizes before a map is made of them; 0: none (docs/curl.md).
  Index curl_rounds = 0;
  LoopOptions loops;  ///< of the standard preset, where there is a rig
  RimOptions rims;    ///< not of the thesis preset
  /// Holes and open ends at most so long around are closed; units of the mesh.
  double fill_holes = 0;
  /// Every hole and notch of the border is followed, however small. Else those smaller than a quad are not: notches are
  /// bridged, and for each hole one quad is left out. Always so in the thesis preset and beside `directions.terms`.
  bool exact_borders = false;
  PolishOptions polish;
  FitOptions fit;
  bool keep_maps = false;  ///< RemeshResult::maps
  SolverChoice solver{};   ///< of every stage

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate() const;
};

/// The symmetry that is looked for, on an asset with or without a rig.
[[nodiscard]] inline SymmetryChoice mirror_choice(const RemeshOptions& options, bool rigged) {
  const bool by_default = rigged && options.preset != FieldPreset::thesis;
  return options.symmetry.value_or(by_default ? SymmetryChoice::automatic : SymmetryChoice::none);
}

/// How the quads of one component were made; every rung gives a valid mesh, the first that does is taken.
enum class Rung : std::uint8_t {
  fine_map,    ///< extracted from the integer-grid map of the whole surface
  coarse_map,  ///< extracted from the quantized coarse map, placed by straight lines of the seamless map
  split,       ///< no valid map: the simplified surface, every polygon split into quads
};
[[nodiscard]] constexpr std::string_view rung_name(Rung rung) {
  constexpr std::array<std::string_view, 3> names{"fine-map", "coarse-map", "split"};
  return names[static_cast<std::size_t>(rung)];
}

struct ComponentReport {
  Index faces = 0;   ///< of the input component
  double asked = 0;  ///< its share of the count
  Index quads = 0, irregular = 0;
  Index singularities = 0;
  Rung rung = Rung::fine_map;
  MapStrain strain;          ///< of the map; zeros where it was split
  CurlReport curl;           ///< of the field that the map was made of; no rounds: as it was
  double kept_length = 0;    ///< of creases and features, units of the mesh
  double kept_as_quads = 0;  ///< of these, how much edges of quads run along
  double edge = 0;           ///< of a square quad, were all as large: the root of area over quads
  double farthest = 0;       ///< point of the surface from the quads, or of the quads from the surface; length
  Vector3 farthest_place = Vector3::Zero();
  double share_missed = 0;  ///< of the surface's area: farther than `edge` from the quads
  double area_ratio = 1;    ///< area of the quads over that of the surface

  /// Whether some of the surface is missing.
  [[nodiscard]] bool misses() const { return farthest > most_edges_off * edge; }
  static constexpr double most_edges_off = 1;
  std::vector<std::string> reasons;  ///< why earlier rungs and attempts were left
};

/// Wall-clock, of components that run side by side the sum; `pieces`: cutting out, refinement and stand-ins.
struct StageSeconds {
  double metric = 0, pieces = 0, field = 0, map = 0, integers = 0, extraction = 0, polish = 0, fit = 0, transfer = 0,
         total = 0;

  /// Of all stages; `total` is not a sum.
  StageSeconds& operator+=(const StageSeconds& other) {
    for (const auto stage : {&StageSeconds::metric, &StageSeconds::pieces, &StageSeconds::field, &StageSeconds::map,
                             &StageSeconds::integers, &StageSeconds::extraction, &StageSeconds::polish,
                             &StageSeconds::fit, &StageSeconds::transfer})
      this->*stage += other.*stage;
    return *this;
  }
};

/// What solved the systems of each stage, in words; empty where a stage had none.
struct StageBackends {
  std::string field, surgery, target, map, untangling;
};

/// What became of the symmetry that was asked for.
struct SymmetryReport {
  SymmetryChoice choice = SymmetryChoice::none;  ///< as asked for, or what stood for it
  std::optional<MirrorPlane> plane;              ///< none: none was found
  Index halved = 0, paired = 0, whole = 0;       ///< components: mirrored across the plane, to each other, not at all
  SymmetrizeReport vertices;                     ///< how many came out as exact mirror images

  /// Of several parts: the first plane, the sums of counts.
  SymmetryReport& operator+=(const SymmetryReport& other) {
    if (!plane) choice = other.choice, plane = other.plane;
    halved += other.halved, paired += other.paired, whole += other.whole;
    vertices.pairs += other.vertices.pairs, vertices.exact += other.vertices.exact;
    vertices.largest = std::max(vertices.largest, other.vertices.largest);
    return *this;
  }
};

/// A joint that bends a limb, and the closed rings of quads that it has.
struct HingeReport {
  std::string joint;  ///< the bone that turns about its head
  Index wanted = 0;   ///< loops: RemeshOptions::loops
  HingeRings rings{};
  Index quads_for = 0;  ///< of the whole that would have as many loops; 0 where there are, or count is not what lacks
};

/// An opening that was found, and the closed rings of quads that its rim has.
struct RimReport {
  Rim rim;
  Index wanted = 0;     ///< rings: RimOptions::rings, or 0 where the opening gets none
  Index loops = 0;      ///< closed loops of edges round it, within so many quads of the rim
  Index around = 0;     ///< quads of the shortest of them
  Index quads_for = 0;  ///< of the whole that would have room for the rings; 0 where there was room
  double edge = 0;      ///< of the quads beside the rim, as asked for; a length
};

/// Gaps of the surface that the quads do not follow.
struct GapReport {
  Index notches = 0;       ///< triangles that bridge a ragged border
  double notch_share = 0;  ///< their area, of that of the surface
  Index holes_filled = 0;  ///< for RemeshOptions::fill_holes
  Index holes_cut = 0;     ///< smaller than a quad: a quad was left out, or a hole cut into one
  Index holes_closed = 0;  ///< likewise, where there was no room for that
};

struct RemeshReport {
  Index quads = 0, vertices = 0, irregular = 0;
  double scaled_jacobian_average = 0, scaled_jacobian_minimum = 0;
  /// `quads` where that is more than the tolerance above what was asked for, as fewer that fit were not found; else 0.
  Index minimum_count = 0;
  std::vector<ComponentReport> components;
  StageSeconds seconds;  ///< summed over components, which may run side by side; `total` is the wall clock
  std::vector<Warning> warnings;
  FieldReport field;                ///< of the largest component
  StageBackends backends;           ///< likewise
  FitReport fit;                    ///< of all components together
  std::vector<HingeReport> hinges;  ///< where there is a rig
  std::vector<RimReport> rims;      ///< where openings were looked for
  SymmetryReport symmetry;
  GapReport gaps;
};

/// Puts the hinges of a result, and what was wanted of them, into its report.
/// \return where that is more the joints, for a warning
/// \cost as hinge_rings
[[nodiscard]] QUADRIG_INLINE std::optional<std::string> report_hinges(const QuadMesh& quads, const Skeleton& skeleton,
                                                                      const SkinWeights& weights,
                                                                      const RemeshOptions& options,
                                                                      RemeshReport& report);

/// Counts the rings that quads have at openings; 0 where the quads are no manifold.
/// \cost O(n) and the neighbourhood of each
QUADRIG_INLINE void count_rings(const QuadMesh& quads, std::span<RimReport> rims);
/// Of openings that have fewer rings than wanted a text for a warning; nothing where there are none.
[[nodiscard]] QUADRIG_INLINE std::optional<std::string> lacking_rings(std::span<const RimReport> rims);

/// The map that the quads of a component are the grid of.
struct ComponentMap {
  TriangleMesh<double> mesh;  ///< its triangles: the component's own, refined, or those of a stand-in
  /// A half-edge: the parameters of its origin in its face, one unit a quad. Of the rung `fine_map` an integer-grid
  /// map, of `coarse_map` the seamless map before integers.
  std::vector<Complex> z;
  std::vector<Index> index4;  ///< I4 a vertex: inside 4 − I4 quads, on the border 2 − I4
  EdgeMarks cut;              ///< edges across which the parameters jump
  Rung rung = Rung::fine_map;
  Index component = 0;  ///< of RemeshReport::components; of one that was mirrored the map is that of its half
};

struct RemeshResult {
  QuadMesh mesh;                       ///< `source`: the points of the asset's mesh nearest to the vertices
  std::optional<SkinWeights> weights;  ///< one row a vertex of `mesh`, where the asset has a rig
  std::vector<Points<double>> morphs;  ///< displacements of the vertices of `mesh`, one matrix a morph of the options
  RemeshReport report;
  std::vector<ComponentMap> maps;  ///< of components that were not split, where `keep_maps` asks for them
  std::vector<Index> twin;         ///< as of UnfittedQuads
};

/// Quads as `remesh` has them before the fit.
struct UnfittedQuads {
  QuadMesh mesh;                  ///< `source` refers to the asset's mesh
  std::vector<char> on_features;  ///< a flag a vertex: on a kept edge
  EdgeMarks kept;                 ///< of the asset's mesh: edges that quads keep; empty: none
  /// A flag a vertex that the fit is to leave where it is beside these; may be changed.
  std::vector<char> held;
  RemeshReport report;  ///< of the stages so far
  std::vector<ComponentMap> maps;
  /// Of each vertex its mirror twin, itself on the plane (RemeshReport::symmetry); empty: none has one.
  std::vector<Index> twin;
  Index holes = 0;                                       ///< that the quads have and the surface has not
  SlideTargets targets;                                  ///< what FitMethod::slide goes by
  std::shared_ptr<const Connection<double>> connection;  ///< of the asset's mesh; `targets` refers to it
};

/// The first part of `remesh`: quads of all components, not fitted yet. Positions may be moved along the surface,
/// `source` with them, before they go on to `fit_and_skin`. \fails as remesh
[[nodiscard]] QUADRIG_INLINE Expected<UnfittedQuads> remesh_unfitted(const Asset& asset, const RemeshOptions& options,
                                                                     Context& context);
/// The second: the fit, and the weights of the rig where the vertices came to lie.
/// \pre asset and options are those of the first \fails as remesh
[[nodiscard]] QUADRIG_INLINE Expected<RemeshResult> fit_and_skin(const Asset& asset, const RemeshOptions& options,
                                                                 UnfittedQuads quads, Context& context);

/// Remeshes an asset that `prepare` let through. Components are remeshed apart, each with its share of the count.
/// The result is the same bits for any number of threads.
/// \fails bad_option; as the solver's factory does; bad_input where the rig does not fit; stage_failed, naming the
///   component and the stage, where no rung gives valid quads; cancelled.
[[nodiscard]] QUADRIG_INLINE Expected<RemeshResult> remesh(const Asset& asset, const RemeshOptions& options,
                                                           Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/pipeline/attempt.ipp"
#include "quadrig/pipeline/component.ipp"
#include "quadrig/pipeline/finish.ipp"
#include "quadrig/pipeline/gaps.ipp"
#include "quadrig/pipeline/hinges.ipp"
#include "quadrig/pipeline/mapped_quads.ipp"
#include "quadrig/pipeline/remesh.ipp"
#include "quadrig/pipeline/rims.ipp"
#endif
