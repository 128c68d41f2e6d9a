// N-RoSy fields: N directions a face, evenly turned, as one complex number each.
#pragma once

#include "quadrig/field/systems.hpp"

namespace quadrig {

/// One complex number a face, the N-th power of any of its N directions; its magnitude says how sure it is.
struct PowerField {
  int n = 4;
  std::vector<Complex> power;

  /// Direction k of a face, 0 ≤ k < n: a unit vector in the face's basis.
  [[nodiscard]] Complex direction(Index face, int k = 0) const {
    const double angle = elementary::arg(power[static_cast<std::size_t>(face)]);
    return elementary::polar(1.0, (angle + 2 * std::numbers::pi * k) / n);
  }
};

struct PowerFieldOptions {
  int n = 4;  ///< 1, 2, 4 or 6 in practice; any n ≥ 1
  /// How far a target reaches, as a fraction of the square root of the area of its component, > 0.
  double smoothing_length = 0.02;
  std::vector<FixedDirection> fixed{};       ///< faces whose direction is given: any one of the n
  std::vector<Complex> target_directions{};  ///< one a face or none: a direction to be near to; 0 for no target
  std::vector<double> target_weights{};      ///< one a face or none, ≥ 0; none: 1 where there is a direction
  SolverChoice solver{};                     ///< of one's own: for meshes of doubles

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate(Index faces) const;
};

struct PowerFieldResult {
  PowerField field;
  std::vector<Index> index;  ///< per vertex inside, N times its index; 0 on the boundary
  Index index_sum = 0;
  Index free_components = 0;  ///< components without target or fixed face: the smallest eigenvector
  double seconds = 0;
};

/// The smoothest N-direction field: where a component has no target and no fixed face, the globally optimal one (the
/// eigenvector of the smallest eigenvalue of the smoothness against area, scaled to mean square 1); else the
/// minimizer of smoothness and distance to the targets.
/// \pre no face of zero area. \cost one sparse factorization, and solves with it for the eigenvector.
/// \fails bad_option; numeric. Source: Knöppel et al. 2013, on faces.
template <class Scalar>
[[nodiscard]] Expected<PowerFieldResult> design_power_field(const TriangleMesh<Scalar>& mesh,
                                                            const Connection<Scalar>& connection,
                                                            const PowerFieldOptions& options, Context& context);

/// Per vertex inside, N times the index of the field; 0 on the boundary. On a closed surface the sum is Nχ.
template <class Scalar>
[[nodiscard]] std::vector<Index> power_field_index(const TriangleMesh<Scalar>& mesh,
                                                   const Connection<Scalar>& connection, const PowerField& field);

namespace detail {
/// A start for inverse iteration made of the surface alone: it turns with the bases and does not see the numbering.
template <class Scalar>
[[nodiscard]] std::vector<Complex> eigenvector_start(const TriangleMesh<Scalar>& mesh,
                                                     const Connection<Scalar>& connection, int power);
}  // namespace detail

}  // namespace quadrig
