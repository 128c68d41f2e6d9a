// What the map should look like: wanted edge vectors per face, made more nearly integrable by correcting lengths.
#pragma once

#include "quadrig/connection.hpp"
#include "quadrig/energy.hpp"
#include "quadrig/seamless/poisson.hpp"
#include "quadrig/solver.hpp"

namespace quadrig {

/// Per half-edge the wanted parameter vector in the combed chart of its face, from densities u, v per face (|u| lines
/// a unit length: one quad is u/|u|² by v/|v|²). \pre v counter-clockwise of u, neither zero
[[nodiscard]] inline TargetEdges target_edges(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                              const CutGraph& cut, const std::vector<Complex>& u,
                                              const std::vector<Complex>& v) {
  using detail::at;
  TargetEdges target(at(mesh.halfedge_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const std::array<Complex, 4> direction{u[at(f)], v[at(f)], -u[at(f)], -v[at(f)]};
    const auto turn = static_cast<std::size_t>(cut.combing[at(f)]);
    Complex a = direction[turn], b = direction[(turn + 1) % 4];
    a /= std::norm(a);
    b /= std::norm(b);
    const double area = cross(a, b);
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      const Complex e = connection.to_complex(f, mesh.edge_vector(h));
      target[at(h)] = {cross(e, b) / area, cross(a, e) / area};
    }
  }
  return target;
}

/// Number of quads that a target asks for: its area.
[[nodiscard]] inline double target_area(const TargetEdges& target) {
  double area = 0;
  for (std::size_t h = 0; h + 2 < target.size(); h += 3) area += cross(target[h], target[h + 1]) / 2;
  return area;
}

/// Σ over interior edges of the squared mismatch of the two sides, relative to their length.
[[nodiscard]] inline double target_curl(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                        const TargetEdges& target) {
  using detail::at;
  double total = 0;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index g = mesh.twin(h);
    if (g < h) continue;
    const Complex across = -rotated(target[at(g)], -cut.rotation[at(h)]);
    total += std::norm(target[at(h)] - across) / std::max(std::norm(target[at(h)] + across) / 4, 1e-300);
  }
  return total;
}

struct LogScaleOptions {
  double fidelity = 4;       ///< λ: resistance to leaving the wanted sizes
  double smoothness = 0.01;  ///< μ
  double largest = 4;        ///< corrections are clipped to [1/largest, largest]
  SolverFactory<double> solver = solver_factory<double>();
};
struct CorrectedTarget {
  TargetEdges target;
  std::string backend;  ///< what solved, in words
};

/// Scales the two parameters of each face by e^a, e^b so that neighbours agree better along their common edge: one
/// symmetric positive definite solve for log lengths on the vertices, where charts that differ by an odd turn swap
/// a and b and a vertex of odd holonomy has a = b.
/// \cost one factorization with at most 2 n unknowns.
[[nodiscard]] QUADRIG_INLINE Expected<CorrectedTarget> correct_log_scale(const TriangleMesh<double>& mesh,
                                                                         const CutGraph& cut,
                                                                         const std::vector<Index>& index,
                                                                         const LogScaleOptions& options,
                                                                         TargetEdges target, Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/seamless/target.ipp"
#endif
