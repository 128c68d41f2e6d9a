// Targets of a field: per face a polynomial or a cross to be near to, or to be equal to.
#pragma once

#include "quadrig/connection.hpp"

namespace quadrig {

/// Polynomial coefficients each face should have: x0 = u²v² and x1 = −(u²+v²) for vectors ±u, ±v in its basis, and how
/// much each face insists. A cross along d has x0 = −d⁴, x1 = 0 (thesis 4.3 with its sign put right).
struct PolyVectorTargets {
  std::vector<Complex> x0, x1;
  std::vector<double> weight;  ///< ≥ 0, per unit of area; 0: no target on this face

  static PolyVectorTargets none(Index faces) {
    const auto m = static_cast<std::size_t>(faces);
    return {std::vector<Complex>(m), std::vector<Complex>(m), std::vector<double>(m, 0.0)};
  }
};

/// A direction that a face's cross has exactly. Any of its four arms will do; the length does not matter.
struct FixedDirection {
  Index face = no_index;
  Complex direction{1};
};

}  // namespace quadrig
