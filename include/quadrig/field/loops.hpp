// Closed curves in a field: how often its directions turn against them.
#pragma once

#include "quadrig/constraints/hinges.hpp"
#include "quadrig/field/matching.hpp"

namespace quadrig {

/// Quarter turns of a loop against the directions of a field along it: 0 where these go round with it, as those of
/// quads that close to rings do; 4 − Σ I4 of a disc to its left.
/// \pre the matching is of the mesh and has whole indices
/// \cost O(crossings)
[[nodiscard]] inline Index quarter_turns(const TriangleMesh<double>& mesh, const Matching& matching,
                                         const FaceLoop& loop) {
  using detail::at;
  // By the way through the middles of edges, which turns as often. Angles are against the edge that is crossed.
  const auto middle = [&](Index h) {
    return Vector3((mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))) / 2);
  };
  const auto angle = [&](Index face, const Vector3& from, const Vector3& to) {
    return elementary::atan2(mesh.normal(face).dot(from.cross(to)), from.dot(to));
  };
  const std::size_t n = loop.crossed.size();
  double turn = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const Index h = loop.crossed[k], before = loop.crossed[(k + n - 1) % n], after = loop.crossed[(k + 1) % n];
    const Vector3 edge = mesh.edge_vector(h);
    turn += matching.rho[at(h)] - angle(h / 3, edge, middle(h) - middle(before));
    turn += angle(mesh.twin(h) / 3, edge, middle(after) - middle(h));
  }
  return static_cast<Index>(std::lround(turn / (std::numbers::pi / 2)));
}

}  // namespace quadrig
