// The cross field of a surface: directions and line densities that follow the rig, the curvature or given targets.
#pragma once

#include "quadrig/field/frames.hpp"
#include "quadrig/field/lengths.hpp"
#include "quadrig/field/matching.hpp"
#include "quadrig/field/power.hpp"
#include "quadrig/field/systems.hpp"
#include "quadrig/rig.hpp"

namespace quadrig {

enum class FieldPreset : std::uint8_t {
  standard,  ///< "default": follows the bones, independent of resolution; without a rig the same as `flat`
  thesis,    ///< the exact energy of the thesis, densities as its roots give them; needs a rig
  flat,      ///< "static": no rig; smooth, along principal curvature where it is pronounced
};

/// "default", "thesis" or "static". \fails bad_option on any other name
[[nodiscard]] Expected<FieldPreset> field_preset(std::string_view name);
[[nodiscard]] std::string_view field_preset_name(FieldPreset preset);

/// Everything not set takes the preset's value. The thesis preset has neither smoothing nor merging, and the densities
/// of its roots; borders, creases, features and fixed directions are held there too, with the lengths that bones ask
/// for. Scalar is that of the mesh: of own terms and solvers, nothing else.
template <class Scalar>
struct BasicFieldOptions {
  using K = std::complex<Scalar>;

  FieldPreset preset = FieldPreset::standard;

  /// How far targets are carried and below which singularities merge: a fraction, in (0, 1], of the square root of
  /// the area of each component. Default 0.01, static 0.05.
  std::optional<double> smoothing_length{};
  /// Length of a quad's edge, or 0: smoothing and merging lengths are at least `merge_quads` of it, so that
  /// singularities closer than a quad merge.
  double quad_edge = 0;
  double merge_quads = 0.5;
  /// Rounds of making every cross a unit and smoothing again over `merge_length` (a fraction like smoothing_length, at
  /// least `merge_quads` quads): pairs of singularities closer than that find each other and vanish. 0: none.
  Index merge_rounds = 10;
  double merge_length = 0.03;

  /// How much bones pull, and principal curvature; ≥ 0. Without a rig there are no bones to pull.
  std::optional<double> bone_weight{};
  std::optional<double> curvature_weight{};
  /// Curvature is averaged over this fraction of the square root of the area of its component, > 0.
  double curvature_length = 0.015;

  /// Poses in which directions are taken from the bones, and averaged; empty: at rest.
  std::vector<Pose> bone_poses{};

  /// Targets of the caller's own, added to the preset's: one entry a face.
  std::optional<PolyVectorTargets> targets{};
  /// Faces whose cross is given.
  std::vector<FixedDirection> fixed{};
  /// The cross follows the border on every face beside it.
  bool follow_boundary = true;
  /// The cross follows creases on both sides: edges that bend more than this, radians, in runs at least as long as
  /// `crease_length` times the square root of the component's area. π: none. Default π, static 0.7 (40°); where more
  /// than a fifth of the faces lie beside such edges the surface is coarse or rough, not creased, and none are held.
  std::optional<double> crease_angle_radians{};
  double crease_length = 0.5;
  /// Half-edges, both of a pair, beside which the cross follows them, whatever they bend.
  std::vector<Index> features{};
  /// Further terms in x0 and in x1, one unknown a face.
  std::vector<AnyTerm<K>> own_terms_x0{}, own_terms_x1{};

  /// Densities: off, |u| = |v| = 1; on, the densities that bones ask for where two of them meet, clamped to [1, 4].
  bool bone_density = false;

  FrameLimits limits{};
  std::string solver{default_solver_name};
  SolverFactory<K> own_solver{};            ///< in the place of `solver` where set
  SolverFactory<Scalar> own_real_solver{};  ///< likewise for the systems of densities

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate(Index faces) const;
};
using FieldOptions = BasicFieldOptions<double>;

struct FieldReport {
  FieldPreset preset = FieldPreset::standard;  ///< the one in force: `flat` where `standard` found no rig
  std::string solver;

  Index vertices = 0, faces = 0, bones = 0, interior_edges = 0;
  double sum_omega1 = 0, sum_omega2 = 0;
  /// Parts of the minimized energy. `thesis`: over faces of area relative to the largest; else of shares of the area.
  double energy_align = 0, energy_smooth = 0, energy_orth = 0;
  double sum_abs_x0 = 0, sum_abs_x1 = 0, median_abs_x0 = 0;
  /// Where ω1 > 0.9: faces, and the angle from the nearer vector to the bone, degrees.
  Index faces_omega1_above_0_9 = 0;
  double mean_angle_to_bone_deg = 0, median_angle_to_bone_deg = 0;
  /// Vertices with positive and with negative I4 inside; 4χ, over the border too.
  Index singularities_plus = 0, singularities_minus = 0, index_sum = 0;

  Index singularities_boundary = 0;
  Index euler_characteristic = 0;
  double smoothing_length = 0;  ///< largest over the components, a length
  Index fixed_faces = 0;
  Index merge_rounds = 0;     ///< rounds taken
  Index free_components = 0;  ///< components that no target pins: the smoothest field there is
  Index bounded_frames = 0;   ///< frames brought within the limits
  FieldSolverReport solve;
  double seconds = 0;
};

struct FieldResult {
  FrameField frames;
  PolyVectorField polynomial;
  Matching matching;
  Singularities singularities;
  std::vector<double> pull;  ///< of each face, how strongly its direction was asked for, in [0, 1]
  FieldReport report;
};

/// The field of a surface and its rig (null: none): frames, matching and singularities, with Gauss–Bonnet and
/// Poincaré–Hopf checked.
/// Of a mesh of floats the matrices and their factors are float too, half as large; results are double, and agree with
/// those of the same mesh in double to about 1e-4 where the field is sure of itself.
/// \pre no face of zero area; `connection` is of the mesh
/// \cost one analysis, two to four sparse factorizations with one complex unknown a face, and about a dozen solves.
/// \fails bad_option, naming it; bad_input where the weights do not fit; numeric where a system is singular (thesis: a
///   component that no bone pulls) or a check fails; cancelled. Source: thesis chapter 4; design of the defaults in
///   docs/field.md.
template <class Scalar>
[[nodiscard]] Expected<FieldResult> design_field(const TriangleMesh<Scalar>& mesh, const Rig* rig,
                                                 const Connection<Scalar>& connection,
                                                 const std::type_identity_t<BasicFieldOptions<Scalar>>& options,
                                                 Context& context);

/// The same for an Asset, or anything that has a mesh and an optional rig.
template <class A, class Scalar>
requires requires(const A& asset) {
  { asset.mesh } -> std::convertible_to<const TriangleMesh<Scalar>&>;
  { asset.rig } -> std::convertible_to<const std::optional<Rig>&>;
}
[[nodiscard]] Expected<FieldResult> design_field(const A& asset, const Connection<Scalar>& connection,
                                                 const std::type_identity_t<BasicFieldOptions<Scalar>>& options,
                                                 Context& context) {
  return design_field<Scalar>(asset.mesh, asset.rig ? &*asset.rig : nullptr, connection, options, context);
}

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/field/design.ipp"
#include "quadrig/field/lengths.ipp"
#include "quadrig/field/power.ipp"
#include "quadrig/field/systems.ipp"
#endif
