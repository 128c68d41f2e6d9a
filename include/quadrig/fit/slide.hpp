// Vertices slide along the surface until the flat quads stray least from it, at rest and in the poses, while edges keep
// to where they run. For quads whose vertices must lie on the surface.
#pragma once

#include "quadrig/closest.hpp"
#include "quadrig/constraints/posed_metric.hpp"
#include "quadrig/quads.hpp"

namespace quadrig {

struct SlideOptions {
  int rounds = 4;  ///< over all vertices; 0: the quads stay as they are
  /// What a quad's shape costs, in mean errors for the square of a sine: corners that are not right, edges that turn
  /// from where they ran, and edges that leave the direction they are given.
  double skew = 3, turn = 1, stray = 5;
  double accepted = 0.8;  ///< a move may not push a scaled Jacobian below this, or below what it was

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate() const;
};

/// What a fit goes by: one value a face of the surface, or nothing, which is the same everywhere.
struct SlideTargets {
  std::vector<double> weight;      ///< how much the error counts there; empty: 1
  std::vector<Vector3> direction;  ///< along or across which edges should run; zero: as they do
  /// Σ_p weight_p d dᵀ over the poses, d = (xx, xy, yy) how much the form of PosedForms differs from that at rest, in
  /// the bases of `connection`: 11, 12, 13, 22, 23, 33.
  std::vector<std::array<double, 6>> bending;
  const Connection<double>* connection = nullptr;

  /// `bending` of these forms; left early, and of no use, where it is cancelled. \cost O(forms)
  void set_bending(const Connection<double>& bases, const PosedForms& forms, const Context& context);
};

struct SlideReport {
  /// Root mean square distance from the quads to the surface, by their centres and edges and by `weight`, and what
  /// bending adds to it; a length.
  double before = 0, after = 0;
  int rounds = 0;
};

/// Moves vertices along the surface, those on a border or in `held` not at all. Every vertex stays on the surface and
/// `source` follows; the same bits for any number of threads.
/// \param held a flag a vertex, or empty: none
/// \pre quads.source has one point a vertex
/// \cost O(rounds · quads) closest-point walks: about ten for each vertex and round. \fails never; leaves early, with
///   sound quads, where it is cancelled.
[[nodiscard]] QUADRIG_INLINE SlideReport slide(const TriangleMesh<double>& mesh, const SlideTargets& targets,
                                               std::vector<char> held, const SlideOptions& options, QuadMesh& quads,
                                               Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/fit/slide.ipp"
#endif
