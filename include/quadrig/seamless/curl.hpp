// How far a field of wanted parameter vectors is from being the gradient of a map.
//
// The mismatch of two faces along their common edge is no curl: it holds how the field changes along its own
// direction, which integrates exactly. Two ways here. On a face, the derivative is taken from its three neighbours,
// unfolded into the face's plane, and the antisymmetric part of it is the curl: a row for `correct_log_scale`, but the
// gradient of a map that is linear on each triangle has some, and thin triangles a lot. About a vertex, what the
// field sums to along the edges opposite to it: none of either.
#pragma once

#include <span>

#include "quadrig/mesh.hpp"
#include "quadrig/seamless/gaussian.hpp"

namespace quadrig {

/// The wanted parametrization: per half-edge its vector in the (combed) chart of its face. Sums to zero over a face.
using TargetEdges = std::vector<Complex>;

namespace detail {

/// One of the two parameters on a face, in the plane of the face.
struct CurlSample {
  Eigen::Vector2d gradient;
  double curl = 0;                      ///< ∂x g_y − ∂y g_x
  std::array<Eigen::Vector2d, 3> hats;  ///< gradients of the hat functions of the corners
};

/// Calls found(face, component, sample) for both parameters of each face that has two neighbours at least, in order.
/// \param rotation of a half-edge: quarter turns from its face's chart to the one across
template <class Rotation, class Found>
void for_each_curl(const TriangleMesh<double>& mesh, const TargetEdges& edges, Rotation&& rotation, Found&& found) {
  using Vector2 = Eigen::Vector2d;
  // The vector whose products with a and b are these.
  const auto gradient = [](const Vector2& a, double along_a, const Vector2& b, double along_b) {
    const double area = a.x() * b.y() - a.y() * b.x();
    return Vector2((along_a * b.y() - along_b * a.y()) / area, (along_b * a.x() - along_a * b.x()) / area);
  };
  const auto part = [](const Complex& z, int component) { return component == 0 ? z.real() : z.imag(); };
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const double area = mesh.area(f);
    if (!(area > 0)) continue;
    const Vector3 origin = mesh.position(mesh.origin(3 * f)), x = mesh.edge_vector(3 * f).normalized(),
                  y = mesh.normal(f).cross(x);
    std::array<Vector2, 3> corner;
    for (int i = 0; i < 3; ++i) {
      const Vector3 p = mesh.position(mesh.origin(3 * f + i)) - origin;
      corner[at(i)] = {p.dot(x), p.dot(y)};
    }
    const Vector2 centre = (corner[0] + corner[1] + corner[2]) / 3;
    std::array<CurlSample, 2> sample;
    for (int c = 0; c < 2; ++c)
      sample[at(c)].gradient = gradient(corner[1] - corner[0], part(edges[at(3 * f)], c), corner[2] - corner[1],
                                        part(edges[at(3 * f + 1)], c));
    Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
    std::array<Eigen::Matrix2d, 2> changes{Eigen::Matrix2d::Zero(), Eigen::Matrix2d::Zero()};
    int neighbours = 0;
    for (int i = 0; i < 3; ++i) {
      const Index h = 3 * f + i, g = mesh.twin(h);
      if (g == no_index) continue;
      const Vector2 a = corner[at(i)], b = corner[at((i + 1) % 3)];
      const double length = (b - a).norm();
      const Vector3 from = mesh.position(mesh.origin(h)), to = mesh.position(mesh.target(h)),
                    tip = mesh.position(mesh.origin(mesh.prev(g))) - from;
      const double along = tip.dot(to - from) / length, height = 2 * mesh.area(g / 3) / length;
      if (!(height > 0)) continue;
      ++neighbours;
      const Vector2 tangent = (b - a) / length, outward(tangent.y(), -tangent.x());
      const Vector2 c = a + along * tangent + height * outward, apart = (a + b + c) / 3 - centre;
      const int turn = -rotation(h);
      const Complex first = rotated(edges[at(g)], turn), second = rotated(edges[at(mesh.next(g))], turn);
      moments += apart * apart.transpose();
      for (int k = 0; k < 2; ++k)
        changes[at(k)] +=
            (gradient(a - b, part(first, k), c - a, part(second, k)) - sample[at(k)].gradient) * apart.transpose();
    }
    if (neighbours < 2 || !(std::abs(moments.determinant()) > 1e-12 * moments.squaredNorm())) continue;
    const Eigen::Matrix2d inverse = moments.inverse();
    for (int c = 0; c < 2; ++c) {
      const Eigen::Matrix2d derivative = changes[at(c)] * inverse;
      sample[at(c)].curl = derivative(1, 0) - derivative(0, 1);
      for (int i = 0; i < 3; ++i) {
        const Vector2 opposite = corner[at((i + 2) % 3)] - corner[at((i + 1) % 3)];
        sample[at(c)].hats[at(i)] = Vector2(-opposite.y(), opposite.x()) / (2 * area);
      }
      found(f, c, sample[at(c)]);
    }
  }
}

/// Of both parameters about a vertex.
struct VertexCurl {
  double area = 0;                 ///< a third of the faces around it
  std::array<double, 2> relative;  ///< |curl g| over the mean |g| there, in the chart of the first corner
  /// Half-edges that leave the vertex, and the quarter turns from the first one's chart to that of each.
  std::span<const std::pair<Index, int>> corners;
};

/// Calls found(curl) where the vertex is inside and no cone.
template <class Found>
void with_vertex_curl(const TriangleMesh<double>& mesh, const std::vector<std::int8_t>& rotation,
                      const TargetEdges& edges, Index v, Found&& found) {
  const Index start = mesh.outgoing(v);
  if (start == no_index || mesh.on_boundary(v)) return;
  std::vector<std::pair<Index, int>> corners;
  int turn = 0;
  Index h = start;
  do {
    corners.emplace_back(h, turn);
    turn += rotation[at(mesh.prev(h))];
    h = mesh.twin(mesh.prev(h));
  } while (h != start);
  if ((turn & 3) != 0) return;
  Complex around = 0;
  std::array<double, 2> size{0, 0};
  double area = 0;
  for (const auto& [corner, turned] : corners) {
    const double face = mesh.area(TriangleMesh<double>::face_of(corner));
    const Complex first = rotated(edges[at(corner)], -turned),
                  opposite = rotated(edges[at(mesh.next(corner))], -turned);
    around += opposite;
    area += face;
    // |g| of what grows by these along the two edges
    const Vector3 a = mesh.edge_vector(corner), b = mesh.edge_vector(mesh.next(corner));
    const auto steepness = [&](double x, double y) { return (x * b - y * a).norm() / 2; };
    size[0] += steepness(first.real(), opposite.real());
    size[1] += steepness(first.imag(), opposite.imag());
  }
  if (!(area > 0)) return;
  // ∫ g × ∇φ over ∫ φ, φ the hat function; steepness is |g| times the area.
  const std::array<double, 2> circulation{std::abs(around.real()), std::abs(around.imag())};
  VertexCurl result{area / 3, {}, corners};
  for (std::size_t c = 0; c < 2; ++c) result.relative[c] = 1.5 * circulation[c] / std::max(size[c], 1e-300);
  found(result);
}

}  // namespace detail
}  // namespace quadrig
