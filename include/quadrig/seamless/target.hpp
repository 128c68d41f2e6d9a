// What the map should look like: wanted edge vectors per face, made more nearly integrable by correcting lengths.
#pragma once

#include "quadrig/connection.hpp"
#include "quadrig/energy.hpp"
#include "quadrig/field/matching.hpp"
#include "quadrig/seamless/curl.hpp"
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

/// How far a field is from being the gradient of a map: |curl g| / |g| of both line densities g, a number over a
/// length. 0 where a map that is linear on each triangle has these gradients, and of second order in the size of even
/// triangles where the field is sampled from the gradient of a smooth map.
struct FieldCurl {
  std::vector<std::array<double, 2>> of_face;  ///< of u and v: mean over its corners; 0 on the border and at cones
  double mean = 0;                             ///< over the area and both directions
  double largest = 0;                          ///< of a vertex
};

/// The curl about each vertex inside that is no cone: against its hat function, as exact as the field's samples are.
/// \pre edges and rotation belong together: wanted vectors in charts, and the quarter turns between these
/// \cost O(m)
[[nodiscard]] inline FieldCurl target_curl(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                                           const TargetEdges& target) {
  using detail::at;
  FieldCurl curl{std::vector<std::array<double, 2>>(at(mesh.face_count()), {0, 0}), 0, 0};
  double area = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v)
    detail::with_vertex_curl(mesh, rotation, target, v, [&](const detail::VertexCurl& about) {
      area += about.area;
      for (const auto& [corner, turn] : about.corners)
        for (int c = 0; c < 2; ++c) curl.of_face[at(corner / 3)][at(c)] += about.relative[at((c + turn) & 1)] / 3;
      for (const double relative : about.relative) {
        curl.mean += about.area * relative / 2;
        curl.largest = std::max(curl.largest, relative);
      }
    });
  if (area > 0) curl.mean /= area;
  return curl;
}

/// The same of frames whose lengths are densities, by their matching.
[[nodiscard]] inline FieldCurl field_curl(const TriangleMesh<double>& mesh, const Connection<double>& connection,
                                          const FrameField& frames, const Matching& matching) {
  CutGraph charts;  // each frame is its own chart
  charts.combing.assign(detail::at(mesh.face_count()), 0);
  std::vector<std::int8_t> rotation;
  for (const auto turns : matching.r) rotation.push_back(static_cast<std::int8_t>(turns & 3));
  return target_curl(mesh, rotation, target_edges(mesh, connection, charts, frames.u, frames.v));
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
