// The rules that every result must keep, and where one is broken.
#pragma once

#include "quadrig/quality/statistics.hpp"
#include "quadrig/rig.hpp"

namespace quadrig {

enum class ValidityRule : std::uint8_t {
  finite_positions,
  vertices_in_range,
  no_degenerate_quads,
  no_duplicate_quads,
  manifold_edges,
  manifold_vertices,
  consistent_orientation,
  no_unused_vertices,
  same_components,
  same_genus,
  same_boundary_loops,
  positive_scaled_jacobian,
  on_the_surface,
  one_weight_row_a_vertex,
  nonnegative_weights,
  weights_sum_to_one,
  few_influences,
};

/// The rule in words: "no quad has a scaled Jacobian of 0 or less".
[[nodiscard]] std::string_view describe(ValidityRule rule);

struct Violation {
  ValidityRule rule;
  Index count = 1;    ///< places where the rule is broken
  std::string where;  ///< the first of them: "quad 17", "edge 3 - 9", "component 2"
  std::string what;   ///< what is there
};

struct ValidityOptions {
  double surface_tolerance = 1e-6;  ///< distance of a vertex from its source, in diagonals of the input
  double weight_tolerance = 1e-6;
  Index influences = 4;
  [[nodiscard]] Status validate() const {
    if (!(surface_tolerance >= 0))
      return Error{ErrorCode::bad_option, "negative", "surface_tolerance", "give 0 or more"};
    if (!(weight_tolerance >= 0)) return Error{ErrorCode::bad_option, "negative", "weight_tolerance", "give 0 or more"};
    if (influences < 1) return Error{ErrorCode::bad_option, "less than 1", "influences", "give 1 or more"};
    return {};
  }
};

struct ValidityReport {
  std::vector<Violation> violations;
  /// Largest distance of a vertex from its point of the input surface, in the units of the mesh.
  double largest_surface_distance = 0;
  MeshStatistics statistics;

  [[nodiscard]] bool valid() const { return violations.empty(); }
  /// stage_failed with the first broken rule, its place, and the number of rules broken. \pre !valid()
  [[nodiscard]] Error error() const;
};

/// Holds the quads against the repaired input that they stand for: pure, manifold, consistently oriented, component by
/// component of the same genus and boundary loops, no scaled Jacobian ≤ 0, no degenerate or duplicate quad, every
/// vertex on the surface; and, where weights are given, that they are a sound skin.
/// \pre the input is an oriented manifold (TriangleMesh is); options are valid
/// \cost O((m + n) log (m + n)). \fails never: what is wrong is in the report.
[[nodiscard]] ValidityReport check_validity(const TriangleMesh<double>& input, const QuadMesh& mesh,
                                            const SkinWeights* weights = nullptr, const ValidityOptions& options = {});

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/quality/validity.ipp"
#endif
