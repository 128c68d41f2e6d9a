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

/// How far a field is from being the gradient of a map, by face: |curl g| / |g| of both line densities g, a number over
/// a length; 0 where a face has fewer than two neighbours.
struct FieldCurl {
  std::vector<std::array<double, 2>> of_face;
  double mean = 0;     ///< over the area and both directions
  double largest = 0;  ///< of a face
};

/// \pre edges and rotation belong together: wanted vectors in charts, and the quarter turns between these
/// \cost O(m)
[[nodiscard]] inline FieldCurl target_curl(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                                           const TargetEdges& target) {
  using detail::at;
  FieldCurl curl{std::vector<std::array<double, 2>>(at(mesh.face_count()), {0, 0}), 0, 0};
  detail::for_each_curl(
      mesh, target, [&](Index h) { return rotation[at(h)]; },
      [&](Index f, int component, const detail::CurlSample& sample) {
        const double relative = std::abs(sample.curl) / std::max(sample.gradient.norm(), 1e-300);
        curl.of_face[at(f)][at(component)] = relative;
        curl.mean += mesh.area(f) * relative / 2;
        curl.largest = std::max(curl.largest, relative);
      });
  if (const double area = mesh.total_area(); area > 0) curl.mean /= area;
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
