// Curvature of a surface as a measure: the bend of each edge, shared between its two faces.
#pragma once

#include "quadrig/constraints/targets.hpp"

namespace quadrig {

/// Integrals of curvature over each face. Divide by the face's area for curvature (1 / length).
struct CurvatureMeasure {
  std::vector<double> mean;  ///< ∫ (κ1 + κ2) / 2, length; positive where the surface is convex
  /// ∫ (κ1 − κ2) / 2 · p1², length: twice the angle of the direction p1 of the larger (signed) curvature κ1.
  std::vector<Complex> deviation;
};

/// Each edge bends by its dihedral angle across itself; half of that belongs to each of its faces. Single faces mean
/// little; averages over a few edge lengths converge to the curvature of the smooth surface, and creases are kept as
/// the strong, directed curvature that they are.
/// \cost O(m). \fails never. Source: Cohen-Steiner and Morvan 2003.
template <class Scalar>
[[nodiscard]] CurvatureMeasure curvature_measure(const TriangleMesh<Scalar>& mesh,
                                                 const Connection<Scalar>& connection) {
  const auto m = static_cast<std::size_t>(mesh.face_count());
  CurvatureMeasure measure{std::vector<double>(m, 0.0), std::vector<Complex>(m)};
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index across = mesh.twin(h);
    if (across == no_index) continue;
    const auto a = mesh.normal(h / 3), b = mesh.normal(across / 3);
    const auto edge = mesh.edge_vector(h);
    const Scalar length = edge.norm();
    if (!(length > 0)) continue;
    const double bend = static_cast<double>(elementary::atan2(a.cross(b).dot(edge) / length, a.dot(b)));
    const double half = bend * static_cast<double>(length) / 2;
    const auto f = static_cast<std::size_t>(h / 3);
    const Complex direction(connection.edge(h));
    measure.mean[f] += half / 2;
    measure.deviation[f] -= half / 2 * direction * direction;  // across the edge: i² = −1
  }
  return measure;
}

}  // namespace quadrig
