// Smoothing along the surface without inversions: quads become rectangles of their own size, the worst ones first.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/quads.hpp"

namespace quadrig {

struct PolishOptions {
  int rounds = 8;
  double accepted = 0.6;  ///< a move may not push a scaled Jacobian below this, or below what it was
  double freed = 0.3;     ///< patches around quads below this are evened out, and the rounds repeated
  double wanted = 0.5;    ///< vertices of quads below this are also searched for a better place

  /// \fails bad_option, names the field.
  [[nodiscard]] QUADRIG_INLINE Status validate() const;
};

struct PolishReport {
  /// Scaled Jacobian; at corners of the border sharper than 90° over the sine of their angle, which no quad exceeds.
  double least_before = 0, least_after = 0;
  double average_before = 0, average_after = 0;
  int rounds = 0;
};

struct PolishedQuads {
  QuadMesh mesh;
  PolishReport report;
};

/// Moves vertices along the source surface; border vertices along the border, those on kept edges along these, corners
/// of either not at all. Every vertex stays on the surface and `source` follows.
/// \param kept marks of the mesh, or empty: none
/// \param held a flag a vertex that is not to move, or empty: none
/// \pre quads.source has one point a vertex; border vertices lie on the border of the mesh
/// \cost O(rounds · quads) closest-point walks. Source: shape projection (Bouaziz et al. 2012) onto rectangles.
[[nodiscard]] QUADRIG_INLINE PolishedQuads polish(const TriangleMesh<double>& mesh, const PolishOptions& options,
                                                  QuadMesh quads, Context& context, const EdgeMarks& kept = {},
                                                  std::span<const char> held = {});

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/polish/polish.ipp"
#endif
