// A triangle mesh with its half-edges, built once, and its per-face geometry.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include <Eigen/Geometry>

#include "quadrig/context.hpp"
#include "quadrig/elementary.hpp"

namespace quadrig {

/// The numbers [first, last), for loops.
class IndexRange {
 public:
  struct Iterator {
    Index at;
    Index operator*() const { return at; }
    Iterator& operator++() { return ++at, *this; }
    bool operator==(const Iterator&) const = default;
  };
  constexpr IndexRange(Index first, Index last) : first_(first), last_(last) {}
  [[nodiscard]] Iterator begin() const { return {first_}; }
  [[nodiscard]] Iterator end() const { return {last_}; }

 private:
  Index first_, last_;
};

/// An oriented edge-manifold triangle mesh. Half-edge h = 3 f + i runs from corner i of face f to corner (i + 1) % 3;
/// corner (f, i) and half-edge 3 f + i share their number. Immutable after creation.
template <class Scalar = double>
class TriangleMesh {
 public:
  using Vector = Eigen::Matrix<Scalar, 3, 1>;

  TriangleMesh() = default;

  /// Takes n×3 positions and m×3 faces, counter-clockwise.
  /// \fails bad_input on an index out of range, a position that is not finite, a face with a repeated vertex, an edge
  ///   with more than two faces, two faces that run an edge the same way, or a vertex whose faces form more than one
  ///   fan: names the face, edge or vertex. `prepare` repairs what can be repaired.
  /// \cost O(m log m) time, 56 m + 28 n bytes in double.
  [[nodiscard]] static Expected<TriangleMesh> create(Points<Scalar> positions, Triangles faces);
  /// The same from other matrices, as Eigen::MatrixXd and MatrixXi.
  /// \fails bad_input too where they do not have 3 columns: names the matrix
  template <EigenMatrix V, EigenMatrix F>
  requires(!(std::is_same_v<V, Points<Scalar>> && std::is_same_v<F, Triangles>))
      [[nodiscard]] static Expected<TriangleMesh> create(const V& positions, const F& faces) {
    Expected<Points<Scalar>> points = with_columns<3>(positions, "positions");
    if (!points) return points.error();
    Expected<Triangles> triangles = with_columns<3>(faces, "faces");
    if (!triangles) return triangles.error();
    return create(std::move(*points), std::move(*triangles));
  }

  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(positions_.rows()); }
  [[nodiscard]] Index face_count() const { return static_cast<Index>(faces_.rows()); }
  [[nodiscard]] Index halfedge_count() const { return 3 * face_count(); }
  [[nodiscard]] Index interior_edge_count() const { return interior_edges_; }
  [[nodiscard]] Index edge_count() const { return halfedge_count() - interior_edges_; }

  [[nodiscard]] const Points<Scalar>& positions() const { return positions_; }
  [[nodiscard]] const Triangles& faces() const { return faces_; }

  [[nodiscard]] static Index face_of(Index halfedge) { return halfedge / 3; }
  /// The three half-edges of a face: `for (Index h : mesh.halfedges_of(f))`.
  [[nodiscard]] static IndexRange halfedges_of(Index face) { return {3 * face, 3 * face + 3}; }
  [[nodiscard]] static Index next(Index halfedge) { return halfedge % 3 == 2 ? halfedge - 2 : halfedge + 1; }
  [[nodiscard]] static Index prev(Index halfedge) { return halfedge % 3 == 0 ? halfedge + 2 : halfedge - 1; }
  /// The half-edge across, or no_index on the boundary.
  [[nodiscard]] Index twin(Index halfedge) const { return twins_[static_cast<std::size_t>(halfedge)]; }
  [[nodiscard]] Index origin(Index halfedge) const { return faces_(halfedge / 3, halfedge % 3); }
  [[nodiscard]] Index target(Index halfedge) const { return origin(next(halfedge)); }
  /// One half-edge of each undirected edge stands for it: the boundary one, or the lower of the two.
  [[nodiscard]] bool is_representative(Index halfedge) const {
    return twin(halfedge) == no_index || halfedge < twin(halfedge);
  }
  /// A half-edge leaving the vertex; on the boundary the first of its fan, so that turning counter-clockwise by
  /// `next_around` meets every face. no_index for a vertex without faces.
  [[nodiscard]] Index outgoing(Index vertex) const { return outgoing_[static_cast<std::size_t>(vertex)]; }
  /// The next half-edge leaving the same vertex, counter-clockwise; no_index past the last face of a boundary fan.
  [[nodiscard]] Index next_around(Index halfedge) const { return twin(prev(halfedge)); }
  /// The next half-edge leaving the same vertex, clockwise; no_index past the first face of a boundary fan.
  [[nodiscard]] Index prev_around(Index halfedge) const {
    const Index across = twin(halfedge);
    return across == no_index ? no_index : next(across);
  }
  /// Every half-edge that leaves the vertex, counter-clockwise from `outgoing`: `for (Index h : mesh.around(v))`. None
  /// for a vertex without faces.
  [[nodiscard]] auto around(Index vertex) const { return Around{this, outgoing(vertex)}; }
  [[nodiscard]] bool on_boundary(Index vertex) const {
    const Index h = outgoing(vertex);
    return h != no_index && twin(h) == no_index;
  }
  [[nodiscard]] bool closed() const { return 2 * interior_edges_ == halfedge_count(); }

  [[nodiscard]] Vector position(Index vertex) const { return positions_.row(vertex).transpose(); }
  [[nodiscard]] Vector edge_vector(Index halfedge) const {
    return position(target(halfedge)) - position(origin(halfedge));
  }
  [[nodiscard]] const Points<Scalar>& normals() const { return normals_; }  ///< m×3, unit; zero where the area is zero
  [[nodiscard]] Vector normal(Index face) const { return normals_.row(face).transpose(); }
  [[nodiscard]] const Eigen::Matrix<Scalar, Eigen::Dynamic, 1>& areas() const { return areas_; }
  [[nodiscard]] Scalar area(Index face) const { return areas_[face]; }
  [[nodiscard]] Scalar total_area() const { return total_area_; }
  /// Angle at a corner, radians.
  [[nodiscard]] Scalar corner_angle(Index corner) const {
    const Vector a = edge_vector(corner), b = -edge_vector(prev(corner));
    return elementary::atan2(a.cross(b).norm(), a.dot(b));
  }
  /// Of the box around all vertices.
  [[nodiscard]] Scalar diagonal() const { return diagonal_; }

 private:
  struct Around {
    struct End {};
    struct Iterator {
      const TriangleMesh* mesh;
      Index at, first;
      Index operator*() const { return at; }
      Iterator& operator++() {
        at = mesh->next_around(at);
        if (at == first) at = no_index;
        return *this;
      }
      bool operator==(End) const { return at == no_index; }
    };
    const TriangleMesh* mesh;
    Index first;
    [[nodiscard]] Iterator begin() const { return {mesh, first, first}; }
    [[nodiscard]] End end() const { return {}; }
  };

  Points<Scalar> positions_, normals_;
  Triangles faces_;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> areas_;
  Scalar total_area_ = 0, diagonal_ = 0;  // asked for inside loops over faces
  std::vector<Index> twins_, outgoing_;
  Index interior_edges_ = 0;
};

/// Half the cotangent of the angle across from a half-edge, held within [1e-3, 1e3]: positive, so that values without
/// sources stay between those of their neighbours whatever the triangles' shape, and bounded, so that no needle
/// outweighs the rest. The sum over the half-edges of an edge is its weight in the Laplacian (Pinkall and Polthier
/// 1993).
template <class Scalar>
[[nodiscard]] double half_cotangent(const TriangleMesh<Scalar>& mesh, Index halfedge) {
  const double angle = static_cast<double>(mesh.corner_angle(mesh.prev(halfedge)));
  const elementary::SinCos at = elementary::sincos(angle);
  return std::clamp(0.5 * at.cos / at.sin, 1e-3, 1e3);
}

/// A point of a surface: a face and its barycentric coordinates (≥ 0, sum 1).
struct SurfacePoint {
  Index face = no_index;
  Vector3 barycentric = Vector3::Zero();
};

template <class Scalar>
[[nodiscard]] Vector3 position(const TriangleMesh<Scalar>& mesh, const SurfacePoint& point) {
  Vector3 p = Vector3::Zero();
  for (int i = 0; i < 3; ++i)
    p += point.barycentric[i] * mesh.position(mesh.faces()(point.face, i)).template cast<double>();
  return p;
}

/// Face components joined through edges.
struct Components {
  Index count = 0;
  std::vector<Index> of_face;  ///< component of each face, numbered by their lowest face
};

template <class Scalar>
[[nodiscard]] Components face_components(const TriangleMesh<Scalar>& mesh) {
  Components result;
  result.of_face.assign(static_cast<std::size_t>(mesh.face_count()), no_index);
  std::vector<Index> stack;
  for (Index seed = 0; seed < mesh.face_count(); ++seed) {
    if (result.of_face[static_cast<std::size_t>(seed)] != no_index) continue;
    const Index component = result.count++;
    result.of_face[static_cast<std::size_t>(seed)] = component;
    stack.assign(1, seed);
    while (!stack.empty()) {
      const Index face = stack.back();
      stack.pop_back();
      for (const Index h : mesh.halfedges_of(face)) {
        const Index across = mesh.twin(h);
        if (across == no_index || result.of_face[static_cast<std::size_t>(across / 3)] != no_index) continue;
        result.of_face[static_cast<std::size_t>(across / 3)] = component;
        stack.push_back(across / 3);
      }
    }
  }
  return result;
}

namespace detail {

struct SortedSide {
  Index low, high, halfedge;  ///< the edge's vertices, low ≤ high
  [[nodiscard]] static SortedSide of(Index a, Index b, Index halfedge) {
    return {std::min(a, b), std::max(a, b), halfedge};
  }
  [[nodiscard]] bool same_edge(const SortedSide& other) const { return low == other.low && high == other.high; }
};

/// The half-edges [0, count) in the order of their edges, as `ends(h)` returns them; those of one edge ascend.
/// \pre ends in [0, vertices). \cost O(count) where few edges share a vertex
template <class Ends>
[[nodiscard]] std::vector<SortedSide> sorted_by_edge(Index vertices, Index count, Ends&& ends) {
  std::vector<Index> begin(static_cast<std::size_t>(vertices) + 1, 0);
  for (Index h = 0; h < count; ++h) ++begin[static_cast<std::size_t>(ends(h).low) + 1];
  for (std::size_t v = 1; v < begin.size(); ++v) begin[v] += begin[v - 1];
  std::vector<SortedSide> sides(static_cast<std::size_t>(count));
  std::vector<Index> next = begin;
  for (Index h = 0; h < count; ++h) {
    const SortedSide side = ends(h);
    sides[static_cast<std::size_t>(next[static_cast<std::size_t>(side.low)]++)] = side;
  }
  for (std::size_t v = 0; v + 1 < begin.size(); ++v)
    std::sort(sides.begin() + begin[v], sides.begin() + begin[v + 1], [](const SortedSide& a, const SortedSide& b) {
      return a.high != b.high ? a.high < b.high : a.halfedge < b.halfedge;
    });
  return sides;
}

/// The same of polygons with as many corners each: half-edge k f + i runs from corner i of row f to the next.
template <int corners>
[[nodiscard]] std::vector<SortedSide> sorted_by_edge(
    Index vertices, const Eigen::Matrix<Index, Eigen::Dynamic, corners, Eigen::RowMajor>& faces) {
  return sorted_by_edge(vertices, static_cast<Index>(faces.size()), [&](Index h) {
    const Index f = h / corners, i = h % corners;
    return SortedSide::of(faces(f, i), faces(f, i + 1 < corners ? i + 1 : 0), h);
  });
}

/// Calls visit(span of sides) for every edge, in order. \pre sides as sorted_by_edge returns them
template <class Visit>
void for_each_edge(std::span<const SortedSide> sides, Visit&& visit) {
  for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
    while (last < sides.size() && sides[last].same_edge(sides[first])) ++last;
    visit(sides.subspan(first, last - first));
  }
}

}  // namespace detail

template <class Scalar>
Expected<TriangleMesh<Scalar>> TriangleMesh<Scalar>::create(Points<Scalar> positions, Triangles faces) {
  const auto fail = [](std::string what, std::string where) {
    return Error{ErrorCode::bad_input, std::move(what), std::move(where), "run prepare() to repair the input"};
  };
  const Index n = static_cast<Index>(positions.rows()), m = static_cast<Index>(faces.rows());
  for (Index v = 0; v < n; ++v)
    if (!positions.row(v).allFinite()) return fail("position is not finite", "vertex " + std::to_string(v));
  for (Index f = 0; f < m; ++f) {
    for (Index i = 0; i < 3; ++i)
      if (faces(f, i) < 0 || faces(f, i) >= n) return fail("vertex index out of range", "face " + std::to_string(f));
    if (faces(f, 0) == faces(f, 1) || faces(f, 1) == faces(f, 2) || faces(f, 2) == faces(f, 0))
      return fail("face repeats a vertex", "face " + std::to_string(f));
  }

  TriangleMesh mesh;
  mesh.positions_ = std::move(positions);
  mesh.faces_ = std::move(faces);
  mesh.twins_.assign(static_cast<std::size_t>(3 * m), no_index);
  mesh.outgoing_.assign(static_cast<std::size_t>(n), no_index);

  const std::vector<detail::SortedSide> sides = detail::sorted_by_edge(n, mesh.faces_);
  for (std::size_t first = 0, last = 0; first < sides.size(); first = last) {
    while (last < sides.size() && sides[last].same_edge(sides[first])) ++last;
    const auto place = [&] {
      return "edge " + std::to_string(sides[first].low) + " - " + std::to_string(sides[first].high);
    };
    if (last - first > 2) return fail("edge has more than two faces", place());
    if (last - first == 2) {
      const Index h = sides[first].halfedge, g = sides[first + 1].halfedge;
      if (mesh.origin(h) == mesh.origin(g)) return fail("neighbouring faces are oriented differently", place());
      mesh.twins_[static_cast<std::size_t>(h)] = g;
      mesh.twins_[static_cast<std::size_t>(g)] = h;
      ++mesh.interior_edges_;
    }
  }
  std::vector<Index> corners(static_cast<std::size_t>(n), 0);
  for (Index h = 0; h < 3 * m; ++h) {
    const auto v = static_cast<std::size_t>(mesh.origin(h));
    ++corners[v];
    if (mesh.outgoing_[v] == no_index || mesh.twin(h) == no_index) mesh.outgoing_[v] = h;
  }
  for (Index v = 0; v < n; ++v) {
    Index seen = 0;
    for ([[maybe_unused]] const Index h : mesh.around(v)) ++seen;
    if (seen != corners[static_cast<std::size_t>(v)])
      return fail("faces around the vertex form more than one fan", "vertex " + std::to_string(v));
  }

  mesh.normals_.resize(m, 3);
  mesh.areas_.resize(m);
  for (Index f = 0; f < m; ++f) {
    const Vector cross = mesh.edge_vector(3 * f).cross(-mesh.edge_vector(3 * f + 2));
    const Scalar length = cross.norm();
    mesh.areas_[f] = length / 2;
    mesh.normals_.row(f) = (length > 0 ? Vector(cross / length) : Vector::Zero()).transpose();
  }
  if (m > 0) mesh.total_area_ = mesh.areas_.sum();
  if (n > 0) mesh.diagonal_ = (mesh.positions_.colwise().maxCoeff() - mesh.positions_.colwise().minCoeff()).norm();
  return mesh;
}

}  // namespace quadrig
