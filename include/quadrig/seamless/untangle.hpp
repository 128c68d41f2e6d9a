// The last flips of a map, taken out where they are: vertices nearby move until every triangle is positive.
#pragma once

#include "quadrig/budget.hpp"
#include "quadrig/seamless/poisson.hpp"

namespace quadrig {

struct UntangleOptions {
  double theta = 0.1;   ///< share of the area in the energy, in (0, 1)
  int iterations = 60;  ///< Newton steps a neighbourhood
  int rings = 48;       ///< largest neighbourhood, in edges from a defect
  /// Triangles times steps that one call may spend, and 5 more for every triangle of the mesh.
  std::int64_t work = 150'000;
  SolverFactory<double> solver = solver_factory<double>();
};

struct UntangleReport {
  int iterations = 0;
  int rings = 0;
  std::int64_t work = 0;  ///< triangles times steps
  bool hopeless = false;  ///< stopped because larger neighbourhoods left more triangles flipped
  std::string backend;    ///< what solved, in words; empty where nothing was to be done
  MapDefects defects;
};

struct UntangledMap {
  std::vector<Complex> z;
  UntangleReport report;
};

/// Moves the regular vertices around flipped triangles and wrong cones until the map is valid, neighbourhood after
/// larger neighbourhood; singular vertices stay, aligned ones slide along their line, and every transition is kept.
/// Where that fails z is as it was and the report has its defects.
/// \param z corner parameters of the map
/// \cost a sparse factorization of the neighbourhood a step, within the budget for untangling. \fails as the solver's
///   factory; cancelled.
/// Source: Garanzha et al., Foldover-free maps in 50 lines of code, 2021, restricted to where it is needed.
[[nodiscard]] QUADRIG_INLINE Expected<UntangledMap> untangle(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                             const std::vector<Index>& index,
                                                             const std::vector<Aligned>& aligned,
                                                             const TargetEdges& target, const UntangleOptions& options,
                                                             std::vector<Complex> z, Context& context, Budget& budget);
/// With a budget of its own.
[[nodiscard]] inline Expected<UntangledMap> untangle(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                     const std::vector<Index>& index,
                                                     const std::vector<Aligned>& aligned, const TargetEdges& target,
                                                     const UntangleOptions& options, std::vector<Complex> z,
                                                     Context& context) {
  Budget budget(mesh.face_count());
  return untangle(mesh, cut, index, aligned, target, options, std::move(z), context, budget);
}

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/seamless/untangle.ipp"
#endif
