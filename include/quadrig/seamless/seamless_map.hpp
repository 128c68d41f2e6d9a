// The arrow from a field to its seamless map, as one value.
#pragma once

#include <variant>

#include "quadrig/seamless/aligned_edges.hpp"
#include "quadrig/seamless/closed_loops.hpp"
#include "quadrig/seamless/measure_strain.hpp"
#include "quadrig/seamless/target.hpp"
#include "quadrig/seamless/untangle.hpp"

namespace quadrig {

struct SeamlessOptions {
  /// The map is scaled to this many quads; 0: to the sizes that the frames ask for.
  double quads = 0;
  /// Edges along which the map is to be straight where the field follows them, marks of the mesh; empty: none. The
  /// border always is.
  EdgeMarks kept{};
  /// Loops that quads are to close along, where the field turns by nothing along them. Those at which a map that closes
  /// them flips are let go: SeamlessReport::closed.
  std::vector<FaceLoop> loops{};
  /// Further solves in which lengths give way to directions. Few: the sizes of this map decide how many quads go where.
  int straightenings = 1;
  /// Returns a map that keeps defects as it is, with them in its report; else it is an error.
  bool accept_defects = false;
  SolverChoice solver{};

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate(const TriangleMesh<double>& mesh) const;
};

struct SeamlessReport {
  MapDefects defects;
  MapStrain strain;                ///< of a valid map
  std::vector<Index> trouble;      ///< where the map keeps defects: faces at which the last solve had them
  std::vector<std::string> tries;  ///< of every solve whose map kept defects, what they were
  std::vector<char> closed;        ///< of each of the loops whether the map closes along it
  std::string target_backend, map_backend, untangling_backend;  ///< what solved, in words; empty where nothing was to
};

/// A parametrization of a connected surface whose transitions are quarter turns and a translation: the same grid of
/// quads on both sides of every edge, up to translations that are no integers yet.
struct SeamlessMap {
  CutGraph cut;                  ///< how the charts hang together
  std::vector<Index> index4;     ///< I4 a vertex: valence 4 − I4 (on the border 2 − I4 quads)
  std::vector<Aligned> aligned;  ///< a half-edge
  TargetEdges target;            ///< the wanted edge vectors, corrected to what fits together
  std::vector<Complex> z;        ///< a half-edge: the parameters of its origin in the chart of its face
  /// z as combinations of what is free: of complex numbers, or of reals where edges are aligned.
  std::variant<MapUnknowns<Complex>, MapUnknowns<double>> unknowns;
  SeamlessReport report;

  [[nodiscard]] bool valid() const { return report.defects.valid(); }
};

/// Number of quads in a map: its area.
[[nodiscard]] inline double map_area(const std::vector<Complex>& z) {
  double area = 0;
  for (std::size_t h = 0; h + 2 < z.size(); h += 3) area += cross(z[h + 1] - z[h], z[h + 2] - z[h]) / 2;
  return area;
}

/// The seamless map of a field with sizes: |u| and |v| of its frames are lines a unit length. The wanted sizes bend
/// ever further to what fits together until no triangle flips and every cone is right; the last defects are untangled.
/// \param matching, singularities of the frames: `match`, `singularities`, or those of a FieldResult
/// \pre `mesh` is connected, without a face of zero area; one frame a face, v counter-clockwise of u, neither zero
/// \cost up to three times a factorization with 2 n unknowns and about a dozen with n, within the budget for maps
/// \fails bad_option; stage_failed where the constraints contradict each other, and where defects are left, naming the
///   first face or vertex; as the backend; cancelled.
/// Source: Bommer et al. 2009; Garanzha et al. 2021; docs/map.md.
[[nodiscard]] QUADRIG_INLINE Expected<SeamlessMap> seamless_map(const TriangleMesh<double>& mesh,
                                                                const Connection<double>& connection,
                                                                const FrameField& frames, const Matching& matching,
                                                                const Singularities& singularities,
                                                                const SeamlessOptions& options, Context& context,
                                                                Budget& budget);

/// The same with the budget of the mesh.
[[nodiscard]] inline Expected<SeamlessMap> seamless_map(const TriangleMesh<double>& mesh,
                                                        const Connection<double>& connection, const FrameField& frames,
                                                        const Matching& matching, const Singularities& singularities,
                                                        const SeamlessOptions& options, Context& context) {
  Budget budget(mesh.face_count());
  return seamless_map(mesh, connection, frames, matching, singularities, options, context, budget);
}

/// Of a FieldResult, or anything else that has frames, their matching and singularities.
template <class Field>
requires requires(const Field& field) {
  { field.frames } -> std::convertible_to<const FrameField&>;
  { field.matching } -> std::convertible_to<const Matching&>;
  { field.singularities } -> std::convertible_to<const Singularities&>;
}
[[nodiscard]] Expected<SeamlessMap> seamless_map(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                                 const Field& field, const SeamlessOptions& options, Context& context) {
  return seamless_map(mesh, connection, field.frames, field.matching, field.singularities, options, context);
}

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/seamless/seamless_map.ipp"
#endif
