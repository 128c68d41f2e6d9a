// Moves the directions and sizes of a field towards those of a map, its matching fixed.
#pragma once

#include <optional>

#include "quadrig/seamless/aligned_edges.hpp"
#include "quadrig/seamless/strain.hpp"
#include "quadrig/seamless/target.hpp"

namespace quadrig {

struct CurlOptions {
  Index rounds = 5;  ///< of a map nearest to the field and a field nearest to the map; 0: the field as it is
  /// How much directions and sizes stay as they were wanted, against the 1 of following the map; ≥ 0.
  double direction_weight = 0.3;
  double size_weight = 0.05;
  /// Edges along which the map is straight where the field follows them, marks of the mesh; empty: none. The border
  /// always is.
  EdgeMarks kept{};
  FrameLimits limits{};  ///< of the frames
  SolverChoice solver{};

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate(const TriangleMesh<double>& mesh) const;
};

struct ReducedField {
  FrameField frames;
  Matching matching;  ///< r as it was, ρ of these frames
  CurlReport report;
};

namespace detail {

/// The wanted edges of quads on a face, in its basis: where the first parameter grows by 1 and the second by nothing,
/// and the other way round.
struct QuadEdges {
  Complex a, b;
};

/// Those of a linear map that takes the edges e0, e1 of a face to d0, d1; none where it turns the face over, or
/// all but.
[[nodiscard]] inline std::optional<QuadEdges> quad_edges(Complex e0, Complex e1, Complex d0, Complex d1) {
  // e → p e + q ē
  const Complex determinant = e0 * std::conj(e1) - e1 * std::conj(e0);
  const Complex p = (d0 * std::conj(e1) - d1 * std::conj(e0)) / determinant, q = (d1 * e0 - d0 * e1) / determinant;
  constexpr double thin = 1e-3;  // of the area of a square as large as the larger stretch
  const double area = std::norm(p) - std::norm(q), stretch = std::abs(p) + std::abs(q);
  if (!(area > thin * stretch * stretch)) return std::nullopt;
  return QuadEdges{(std::conj(p) - q) / area, Complex(0, 1) * (std::conj(p) + q) / area};
}

}  // namespace detail

/// The field with less curl: the map nearest to it, whose transitions are those of the matching with any translations,
/// and the field nearest to both that map and the frames as they were, in turns. Singularities, matching and the
/// directions along the border stay; a field that is the gradient of a map stays as it is.
/// \param matching, singularities of the frames, as for `seamless_map`; the mesh may have several components
/// \pre one frame a face, v counter-clockwise of u, neither zero; no face of zero area
/// \cost one analysis and one factorization with n unknowns (2 n where a border or a kept edge is), a solve a round
/// \fails bad_option; stage_failed where the constraints contradict each other; as the backend; cancelled.
/// Source: the thesis's first future work; alternate projections as in Diamanti et al. 2015's discussion of curl, with
/// the linear set of gradients of Bommer et al. 2009.
[[nodiscard]] QUADRIG_INLINE Expected<ReducedField> reduce_curl(const TriangleMesh<double>& mesh,
                                                                const Connection<double>& connection,
                                                                const FrameField& frames, const Matching& matching,
                                                                const Singularities& singularities,
                                                                const CurlOptions& options, Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/seamless/reduce_curl.ipp"
#endif
