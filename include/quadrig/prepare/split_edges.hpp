// Edges cut in the middle, all at once: what a map needs where an edge joins two vertices of the border.
#pragma once

#include <functional>

#include "quadrig/prepare.hpp"

namespace quadrig {

/// Cuts every edge marked by one of its half-edges at its midpoint, or at `share(h)` of the way along its lower
/// half-edge; a face with one, two or three cut edges becomes two, three or four. The surface stays exactly as it is.
/// \cost O(m)
[[nodiscard]] inline Refinement split_edges(const TriangleMesh<double>& mesh, const std::vector<char>& marked,
                                            const std::function<double(Index)>& share = {}) {
  using detail::at;
  const Index n = mesh.vertex_count();
  std::vector<Index> middle(marked.size(), no_index);
  std::vector<SurfacePoint> source(at(n));
  for (Index v = 0; v < n; ++v) {
    const Index h = mesh.outgoing(v);
    if (h == no_index) continue;
    source[at(v)].face = h / 3;
    source[at(v)].barycentric[h % 3] = 1;
  }
  Index vertices = n;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index g = mesh.twin(h);
    if (middle[at(h)] != no_index || !(marked[at(h)] || (g != no_index && marked[at(g)]))) continue;
    middle[at(h)] = vertices++;
    if (g != no_index) middle[at(g)] = middle[at(h)];
    SurfacePoint point{h / 3, Vector3::Zero()};
    const double t = share ? share(h) : 0.5;
    point.barycentric[h % 3] = 1 - t;
    point.barycentric[(h % 3 + 1) % 3] = t;
    source.push_back(point);
  }
  Points<double> positions(vertices, 3);
  positions.topRows(n) = mesh.positions();
  for (Index v = n; v < vertices; ++v) positions.row(v) = position(mesh, source[at(v)]).transpose();
  std::vector<std::array<Index, 3>> faces;
  std::vector<Index> parent;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const std::array<Index, 3> m{middle[at(3 * f)], middle[at(3 * f + 1)], middle[at(3 * f + 2)]};
    const std::array<Index, 3> v{mesh.faces()(f, 0), mesh.faces()(f, 1), mesh.faces()(f, 2)};
    const std::size_t before = faces.size();
    const auto count = std::count_if(m.begin(), m.end(), [](Index i) { return i != no_index; });
    std::size_t s = 0;  // first corner: of the one cut edge, or after the one uncut edge
    if (count == 1)
      while (m[s] == no_index) ++s;
    if (count == 2)
      while (m[(s + 2) % 3] != no_index) ++s;
    const Index a = v[s], b = v[(s + 1) % 3], c = v[(s + 2) % 3];
    const Index ab = m[s], bc = m[(s + 1) % 3], ca = m[(s + 2) % 3];
    switch (count) {
      case 0:
        faces.push_back({a, b, c});
        break;
      case 1:
        faces.insert(faces.end(), {{a, ab, c}, {ab, b, c}});
        break;
      case 2:
        faces.insert(faces.end(), {{ab, b, bc}, {a, ab, bc}, {a, bc, c}});
        break;
      default:
        faces.insert(faces.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
        break;
    }
    parent.insert(parent.end(), faces.size() - before, f);
  }
  Triangles triangles(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int i = 0; i < 3; ++i) triangles(static_cast<Eigen::Index>(f), i) = faces[f][static_cast<std::size_t>(i)];
  Expected<TriangleMesh<double>> fine = TriangleMesh<double>::create(std::move(positions), std::move(triangles));
  assert(fine);
  return {std::move(*fine), std::move(source), std::move(parent)};
}

}  // namespace quadrig
