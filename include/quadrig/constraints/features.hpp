// Directions that a field must have: along borders and creases.
#pragma once

#include <span>

#include "quadrig/constraints/targets.hpp"
#include "quadrig/disjoint_sets.hpp"

namespace quadrig {

/// Angle between the normals of the two faces of a half-edge, radians in [0, π]; 0 on the boundary.
template <class Scalar>
[[nodiscard]] Scalar dihedral_angle(const TriangleMesh<Scalar>& mesh, Index halfedge) {
  const Index across = mesh.twin(halfedge);
  if (across == no_index) return 0;
  const auto a = mesh.normal(halfedge / 3), b = mesh.normal(across / 3);
  return elementary::atan2(a.cross(b).norm(), a.dot(b));
}

/// Half-edges, both of a pair, whose dihedral angle is above the limit and that are connected, by shared vertices, with
/// others of at least `least_length` in all: a noisy scan bends sharply at many single edges, a crease runs on. The
/// `least_length` is called with a face of each, so that it may depend on the component.
/// Ascending. A limit of π or more: none. \cost O(m). \fails never
template <class Scalar>
[[nodiscard]] std::vector<Index> crease_halfedges(const TriangleMesh<Scalar>& mesh, double limit_radians,
                                                  function_ref<double(Index)> least_length) {
  std::vector<Index> creases;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) != no_index && static_cast<double>(dihedral_angle(mesh, h)) > limit_radians) creases.push_back(h);
  DisjointSets connected(detail::at(mesh.vertex_count()));
  for (const Index h : creases) connected.join(mesh.origin(h), mesh.target(h));
  std::vector<double> length(connected.size(), 0.0);
  const auto length_of = [&](Index h) -> double& { return length[detail::at(connected.find(mesh.origin(h)))]; };
  for (const Index h : creases) length_of(h) += static_cast<double>(mesh.edge_vector(h).norm()) / 2;
  std::erase_if(creases, [&](Index h) { return length_of(h) < least_length(mesh.face_of(h)); });
  return creases;
}
template <class Scalar>
[[nodiscard]] std::vector<Index> crease_halfedges(const TriangleMesh<Scalar>& mesh, double limit_radians) {
  const auto any = [](Index) { return 0.0; };
  return crease_halfedges(mesh, limit_radians, function_ref<double(Index)>(any));
}

/// Half-edges, both of a pair, between faces of different labels: materials, regions, groups. Ascending.
/// \param label one a face \cost O(m)
template <class Scalar>
[[nodiscard]] std::vector<Index> label_borders(const TriangleMesh<Scalar>& mesh, std::span<const Index> label) {
  std::vector<Index> borders;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (const Index g = mesh.twin(h);
        g != no_index && label[static_cast<std::size_t>(h / 3)] != label[static_cast<std::size_t>(g / 3)])
      borders.push_back(h);
  return borders;
}

template <class Scalar>
[[nodiscard]] std::vector<Index> boundary_halfedges(const TriangleMesh<Scalar>& mesh) {
  std::vector<Index> boundary;
  for (Index h = 0; h < mesh.halfedge_count(); ++h)
    if (mesh.twin(h) == no_index) boundary.push_back(h);
  return boundary;
}

/// One direction for each face that has one of the half-edges, along it; along the longest (ties: the lowest) where
/// a face has several. Ascending by face.
/// \cost O(k log k) for k half-edges. \fails never
template <class Scalar>
[[nodiscard]] std::vector<FixedDirection> directions_along(const TriangleMesh<Scalar>& mesh,
                                                           const Connection<Scalar>& connection,
                                                           std::vector<Index> halfedges) {
  std::sort(halfedges.begin(), halfedges.end());
  halfedges.erase(std::unique(halfedges.begin(), halfedges.end()), halfedges.end());
  std::vector<FixedDirection> fixed;
  Scalar longest = 0;
  for (const Index h : halfedges) {
    const Scalar length = mesh.edge_vector(h).squaredNorm();
    const bool same_face = !fixed.empty() && fixed.back().face == h / 3;
    if (same_face && length <= longest) continue;
    longest = length;
    const FixedDirection direction{h / 3, Complex(connection.edge(h))};
    if (same_face)
      fixed.back() = direction;
    else
      fixed.push_back(direction);
  }
  return fixed;
}

}  // namespace quadrig
