// Gaps of a surface that are smaller than what is looked at: pinholes, and notches of a ragged border.
#pragma once

#include <optional>
#include <vector>

#include "quadrig/mesh.hpp"

namespace quadrig {

struct GapOptions {
  double hole = 0;   ///< holes at most so long around are closed; length
  double end = 0;    ///< likewise, and open ends of tubes; never the outline of a sheet
  double notch = 0;  ///< notches of a ragged border at most so deep, and twice as wide, are filled; length
};

/// A surface without its small gaps. The first faces are those of the source, which has the same vertices; of vertices
/// at one position on the rim of a closed hole one is left, the others have no face.
struct Bridged {
  struct Hole {
    Vector3 centre = Vector3::Zero();
    double length = 0;  ///< around
  };
  TriangleMesh<double> mesh;
  std::vector<Hole> holes;
  Index notches = 0;       ///< triangles that fill such
  double notch_area = 0;   ///< of these
  Index left_open = 0;     ///< holes that are small enough, but that no triangles close
  Index faces_before = 0;  ///< of the source; those behind fill gaps
};

/// Fills gaps with triangles between vertices that are there.
///
/// A border is ragged where it turns to and fro: within twice `notch` along it to both sides, the turns of its vertices
/// (π minus the angles of the surface) sum to `ragged_radians` more without their signs than with them. A corner, a
/// curve and the end of a slit turn one way, and stay.
/// \return nothing where there is no such gap, or once cancelled
/// \cost O(m) and, of b border vertices of which a notch's reach has r, O(b (r + log b)); a hole of n corners O(n²)
[[nodiscard]] QUADRIG_INLINE std::optional<Bridged> bridge_gaps(const TriangleMesh<double>& mesh,
                                                                const GapOptions& options, const Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/prepare/gaps.ipp"
#endif
