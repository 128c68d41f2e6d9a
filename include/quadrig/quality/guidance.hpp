// How the quads follow the rig: edges along the bones, quads where the surface blends, loops round the hinges.
#pragma once

#include "quadrig/quality/statistics.hpp"
#include "quadrig/rig.hpp"

namespace quadrig {

/// A part of the surface by what rules it.
struct RegionDensity {
  Index bone = no_index;  ///< the bone that rules here (ω1 > limit); no_index where bones blend
  double area_share = 0;  ///< of the input surface
  double quad_share = 0;  ///< of the quads; a quad counts a quarter to the region of each of its corners
  /// Quads a unit area, relative to the mean.
  [[nodiscard]] double density() const { return area_share > 0 ? quad_share / area_share : 0; }
};

struct GuidanceFigures {
  /// Between each edge and the nearer of the ruling bone and its normal in the tangent plane, where ω1 > limit.
  double bone_angle_mean_degrees = 0, bone_angle_median_degrees = 0, bone_angle_p99_degrees = 0;
  Index bone_edges = 0;  ///< edges that were compared
  /// Blending parts first, then the bones that rule anywhere, ascending.
  std::vector<RegionDensity> regions;
  double irregular_where_blending = 0;  ///< share of the irregular interior vertices, in [0, 1]; 0 where there are none
  /// Per bone, closed edge loops round its hinge (its head, where it hangs on another bone): once round the axis, all
  /// of it in the blend. An artist wants three or more. 0 for roots.
  std::vector<Index> hinge_loops;
};

struct GuidanceOptions {
  double rule_limit = 0.9;        ///< ω1 above which one bone rules
  double least_projection = 0.2;  ///< a bone nearer to the surface normal than this (sine) has no direction there

  /// \fails bad_option, names the field.
  [[nodiscard]] QUADRIG_INLINE Status validate() const;
};

/// \pre mesh.source lies on `input`; its skin weights have one row a vertex and one column a bone of the skeleton
/// \cost O(m + n + bones · loops). \fails bad_option by validate(); bad_input where the rig
/// does not fit
[[nodiscard]] Expected<GuidanceFigures> guidance_figures(const TriangleMesh<double>& input, const Rig& rig,
                                                         const QuadMesh& mesh, const GuidanceOptions& options = {});

/// Closed chains of edges that go straight on at every vertex: each is its half-edges, 4 q + i running from corner i of
/// quad q to the next; every vertex on them is interior and has four edges. Each loop once, by its lowest half-edge.
/// \pre an oriented manifold. \cost O(m log m)
[[nodiscard]] std::vector<std::vector<Index>> edge_loops(const Quads& quads);
template <class... Arguments>
requires(RuntimeColumns<Arguments> || ...) void edge_loops(const Arguments&...) = delete;  // see with_columns

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quality/guidance.ipp"
#endif
