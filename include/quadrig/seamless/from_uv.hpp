// A seamless map of one's own: corner coordinates that any other program made, checked and taken over.
#pragma once

#include "quadrig/seamless/seamless_map.hpp"

namespace quadrig {

/// One row a corner, 3 f + i of face f: texture coordinates, one unit a quad.
using CornerUv = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// Corner coordinates from a list of coordinates and the number of one for every corner of every face, as files of
/// meshes have them.
/// \param uv k×2 \param faces m×3, rows of `uv`
/// \fails bad_input where a number is not in the list, or the number of columns is wrong
[[nodiscard]] QUADRIG_INLINE Expected<CornerUv> corner_uv(const Eigen::MatrixXd& uv, const Eigen::MatrixXi& faces);

struct UvOptions {
  /// How far, of the length of an edge, the two sides of it may disagree, and a border edge or a kept one be from a
  /// grid line: what rounding of a file leaves. Within it the map is projected to one that is exactly seamless.
  double tolerance = 1e-3;
  EdgeMarks kept{};  ///< edges along grid lines that quads must keep; empty: none. The border always is.
  SolverChoice solver{};

  /// \fails bad_option, naming the field
  [[nodiscard]] Status validate(const TriangleMesh<double>& mesh) const;
};

/// The seamless map of given corner coordinates, at their scale.
/// \pre `mesh` is connected
/// \cost one factorization with at most 2 n unknowns
/// \fails bad_option; bad_input, naming the face, edge or vertex: coordinates that are not finite or not one row a
/// corner;
///   a triangle that is flipped or has no area; an edge across which the map does not change by a quarter turn and a
///   translation; a border edge or a kept one that is no grid line; a vertex that is wound around more than once or not
///   at all. stage_failed where what is given contradicts itself all the same; as the backend; cancelled.
[[nodiscard]] QUADRIG_INLINE Expected<SeamlessMap> seamless_from_uv(const TriangleMesh<double>& mesh,
                                                                    const CornerUv& uv, const UvOptions& options,
                                                                    Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/seamless/from_uv.ipp"
#endif
