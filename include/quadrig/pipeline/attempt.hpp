// One attempt of the ladder on one component: field, cleaned field, seamless map, quads. A value comes back, whatever
// became of it.
#pragma once

#include "quadrig/pipeline.hpp"
#include "quadrig/pipeline/component.hpp"
#include "quadrig/pipeline/halves.hpp"
#include "quadrig/pipeline/ladder.hpp"
#include "quadrig/pipeline/mapped_quads.hpp"
#include "quadrig/pipeline/piece.hpp"

namespace quadrig::detail {

/// What all attempts on a component share.
struct AttemptShared {
  const RemeshShared& asset;
  const Piece& original;                   ///< the component itself
  double quads = 0;                        ///< its share of the count
  double area = 0;                         ///< of the component
  double edge = 0;                         ///< of a square quad
  const SurfaceTopology* whole = nullptr;  ///< of the component that this is a half of; null: it is none
  bool lays_rings = true;                  ///< those of the asset
};

/// Quads that an attempt found, with the surface that they lie on.
struct FoundQuads {
  MadeQuads made;
  TriangleMesh<double> surface;
  EdgeMarks kept, mirror;
  std::vector<Index> parent;
  std::vector<char> landed;  ///< vertices that hold tips of the surface
  double farthest = 0;       ///< point of the surface from the quads, in edges of these
  double average = 0;        ///< scaled Jacobian
  Index singularities = 0;
  FieldReport field;
  MapStrain strain;
  CurlReport curl;
  std::optional<ComponentMap> map;  ///< where RemeshOptions::keep_maps asks for it
};

/// Features that nobody asked for are let go where quads are less even on average, by their scaled Jacobians.
inline constexpr double even_enough = 0.9;
/// Points farther than this from the quads, in edges of these, are missed: the fit may still cost a little.
inline constexpr double covered_edges = 0.85 * ComponentReport::most_edges_off;

struct AttemptResult {
  Outcome outcome = Outcome::flat;
  std::optional<FoundQuads> found;
  std::vector<std::string> reasons;  ///< in words, of all that was left on the way
  std::int64_t share_left = 1;       ///< of the attempt's share of the maps
  StageSeconds seconds;
  StageBackends backends;
};

/// \param piece the triangles of the attempt
/// \param afresh whether the attempt begins with a full budget
/// \param mend whether the field is changed where its map fails; else one map is tried
/// \fails cancelled, bad_option; all else is an outcome
[[nodiscard]] QUADRIG_INLINE Expected<AttemptResult> run_attempt(const AttemptShared& shared, const Attempt& attempt,
                                                                 Piece piece, bool afresh, bool mend, Context& context,
                                                                 Budget& budget);

}  // namespace quadrig::detail
