// Marked edges of a surface gathered in curves: its border, creases, seams, whatever quads must keep.
#pragma once

#include <optional>
#include <span>

#include "quadrig/mesh.hpp"

namespace quadrig {

/// A flag a half-edge, the same on both of a pair.
using EdgeMarks = std::vector<char>;

/// The border of a mesh as marks. \cost O(m)
[[nodiscard]] inline EdgeMarks border_marks(const TriangleMesh<double>& mesh) {
  EdgeMarks marks(detail::at(mesh.halfedge_count()), 0);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) marks[detail::at(h)] = mesh.twin(h) == no_index;
  return marks;
}

/// What either marks; `more` may be empty: none. \cost O(m)
[[nodiscard]] inline EdgeMarks joined_marks(EdgeMarks marks, const EdgeMarks& more) {
  for (std::size_t h = 0; h < more.size(); ++h) marks[h] = marks[h] || more[h];
  return marks;
}

/// A mesh cut open along marked edges: the same faces, and a vertex for each fan of them between marks.
struct CutOpen {
  TriangleMesh<double> mesh;
  std::vector<Index> parent;  ///< of each vertex the one that it was
};
/// \cost O(m)
[[nodiscard]] inline CutOpen cut_open(const TriangleMesh<double>& mesh, const EdgeMarks& marks) {
  Triangles faces(mesh.face_count(), 3);
  CutOpen result;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    std::vector<Index> fan;  // half-edges that leave v, counter-clockwise
    std::size_t first = 0;   // of them the first behind a mark
    for (const Index h : mesh.around(v)) fan.push_back(h);
    while (first < fan.size() && mesh.twin(fan[first]) != no_index && !marks[detail::at(fan[first])]) ++first;
    for (std::size_t k = 0; k < fan.size(); ++k) {
      const Index h = fan[(first + k) % fan.size()];
      if (k == 0 || marks[detail::at(h)]) result.parent.push_back(v);
      faces(h / 3, h % 3) = static_cast<Index>(result.parent.size()) - 1;
    }
    if (fan.empty()) result.parent.push_back(v);
  }
  Points<double> positions(static_cast<Index>(result.parent.size()), 3);
  for (std::size_t v = 0; v < result.parent.size(); ++v)
    positions.row(static_cast<Index>(v)) = mesh.positions().row(result.parent[v]);
  result.mesh = TriangleMesh<double>::create(std::move(positions), std::move(faces)).value();
  return result;
}

/// Curves of marked edges: from corner to corner, or closed. A corner is where other than two of them meet, or, inside
/// the surface, where two bend by more than an angle within it.
class EdgeCurves {
 public:
  static constexpr double no_bend = std::numbers::pi, eighth = no_bend / 4;

  /// Curves run along the border as its half-edges do. Keeps a reference to the mesh. \cost O(m)
  EdgeCurves(const TriangleMesh<double>& mesh, const EdgeMarks& marks, double bend_radians = no_bend) : mesh_(mesh) {
    place_.assign(at(mesh.halfedge_count()), {no_index, no_index});
    corner_.assign(at(mesh.vertex_count()), 0);
    std::vector<std::array<Index, 2>> leaving(at(mesh.vertex_count()), {no_index, no_index});
    std::vector<Index> degree(at(mesh.vertex_count()), 0);
    const auto leave = [&](Index v, Index h) {
      if (degree[at(v)] < 2) leaving[at(v)][at(degree[at(v)])] = h;
      ++degree[at(v)];
    };
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      if (!marks[at(h)]) continue;
      leave(mesh.origin(h), h);
      if (mesh.twin(h) == no_index) ++degree[at(mesh.target(h))];
    }
    for (Index v = 0; v < mesh.vertex_count(); ++v)
      corner_[at(v)] = degree[at(v)] != 0 && (degree[at(v)] != 2 || bends(v, leaving[at(v)], bend_radians));
    // The marked half-edge that leaves v and does not go back; none at a corner.
    const auto onward = [&](Index h) -> Index {
      const Index v = mesh.target(h);
      if (corner_[at(v)]) return no_index;
      for (const Index g : leaving[at(v)])
        if (g != no_index && g != mesh.twin(h)) return g;
      return no_index;
    };
    const auto walk = [&](Index start) {
      Curve curve;
      for (Index h = start; h != no_index && place_[at(h)][0] == no_index; h = onward(h)) {
        const std::array<Index, 2> place{static_cast<Index>(curves_.size()),
                                         static_cast<Index>(curve.halfedges.size())};
        place_[at(h)] = place;
        if (const Index g = mesh.twin(h); g != no_index) place_[at(g)] = place;
        curve.halfedges.push_back(h);
        curve.begins.push_back(curve.length);
        curve.length += mesh.edge_vector(h).norm();
      }
      curve.closed = mesh.target(curve.halfedges.back()) == mesh.origin(start) && !corner_[at(mesh.origin(start))];
      curve.border = mesh.twin(start) == no_index;
      curves_.push_back(std::move(curve));
    };
    const auto fresh = [&](Index h) { return marks[at(h)] && place_[at(h)][0] == no_index; };
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (corner_[at(mesh.origin(h))] && fresh(h)) walk(h);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (fresh(h)) walk(h);
  }

  [[nodiscard]] bool empty() const { return curves_.empty(); }
  [[nodiscard]] bool corner(Index vertex) const { return corner_[at(vertex)] != 0; }
  [[nodiscard]] bool marked(Index halfedge) const { return place_[at(halfedge)][0] != no_index; }
  [[nodiscard]] double length() const {
    double sum = 0;
    for (const Curve& curve : curves_) sum += curve.length;
    return sum;
  }

  /// A half-edge that turns as its curve does, the marked one or its twin. \pre marked
  [[nodiscard]] Index along(Index halfedge) const {
    const auto [curve, number] = place_[at(halfedge)];
    return curves_[at(curve)].halfedges[at(number)];
  }
  /// The next of the curve, or the one before; no_index past an end. \pre halfedge is one that `along` returned
  [[nodiscard]] Index beside(Index halfedge, bool ahead) const {
    const auto [number_of_curve, number] = place_[at(halfedge)];
    const Curve& curve = curves_[at(number_of_curve)];
    const auto count = static_cast<Index>(curve.halfedges.size());
    const Index next = ahead ? number + 1 : number - 1;
    if (next >= 0 && next < count) return curve.halfedges[at(next)];
    return curve.closed ? curve.halfedges[at(ahead ? 0 : count - 1)] : no_index;
  }

  /// The marked half-edge, turned as its curve, that a point lies on within `tolerance`, a barycentric coordinate; at a
  /// vertex one of those that meet there. no_index: none. \cost O(degree) at a vertex
  [[nodiscard]] Index under(const SurfacePoint& point, double tolerance = 0) const {
    for (int i = 0; i < 3; ++i)
      if (const Index h = 3 * point.face + i; marked(h) && point.barycentric[(i + 2) % 3] <= tolerance) return along(h);
    for (int i = 0; i < 3; ++i)
      if (point.barycentric[i] >= 1 - tolerance)
        if (const Index h = leaving(mesh_.faces()(point.face, i)); h != no_index) return along(h);
    return no_index;
  }

  /// The point at a share of the way along a curve from one of its points to another, the shorter way of a closed one,
  /// or with the border where it is that. Nothing where no curve has both.
  [[nodiscard]] std::optional<SurfacePoint> between(const SurfacePoint& from, const SurfacePoint& to,
                                                    double share) const {
    const std::optional<Way> way = way_between(from, to);
    if (!way) return std::nullopt;
    const Curve& curve = curves_[at(way->curve)];
    double along = way->begin + share * way->length;
    if (along >= curve.length) along -= curve.closed ? curve.length : 0;
    if (along < 0) along += curve.length;
    const auto next = std::upper_bound(curve.begins.begin(), curve.begins.end(), along);
    const auto k = static_cast<std::size_t>(next - curve.begins.begin()) - 1;
    const Index h = curve.halfedges[k];
    const double length = mesh_.edge_vector(h).norm();
    const double t = length > 0 ? std::clamp((along - curve.begins[k]) / length, 0.0, 1.0) : 0.0;
    SurfacePoint point{h / 3, Vector3::Zero()};
    point.barycentric[h % 3] = 1 - t;
    point.barycentric[(h % 3 + 1) % 3] = t;
    return point;
  }
  /// How far it is from one point to the other along a curve that has both; nothing where none has.
  [[nodiscard]] std::optional<double> distance(const SurfacePoint& from, const SurfacePoint& to,
                                               double tolerance = 0) const {
    const std::optional<Way> way = way_between(from, to, tolerance);
    return way ? std::optional(std::abs(way->length)) : std::nullopt;
  }

 private:
  struct Curve {
    std::vector<Index> halfedges;
    std::vector<double> begins;
    double length = 0;
    bool closed = false, border = false;
  };
  struct Location {
    Index curve;
    double along;
  };
  struct Way {
    Index curve;
    double begin, length;  // the length is negative against the curve
  };

  [[nodiscard]] static std::size_t at(Index i) { return detail::at(i); }

  /// Whether two edges meet inside the surface further than that from half of the angle around the vertex.
  [[nodiscard]] bool bends(Index v, const std::array<Index, 2>& edges, double most) const {
    if (most >= no_bend || mesh_.on_boundary(v)) return false;
    double turned = 0, first = 0, second = 0;
    for (const Index h : mesh_.around(v)) {
      if (h == edges[0]) first = turned;
      if (h == edges[1]) second = turned;
      turned += mesh_.corner_angle(h);
    }
    return std::abs(std::abs(second - first) - turned / 2) > most;
  }

  /// A marked half-edge at the vertex, leaving it or, at the end of a border, coming in.
  [[nodiscard]] Index leaving(Index v) const {
    for (const Index h : mesh_.around(v)) {
      if (marked(h)) return h;
      if (const Index in = mesh_.prev(h); mesh_.twin(in) == no_index && marked(in)) return in;
    }
    return no_index;
  }

  /// Every place of the point on curves: at a corner one on each that ends there.
  [[nodiscard]] std::vector<Location> locate(const SurfacePoint& point, double tolerance) const {
    std::vector<Location> found;
    const auto add = [&](Index h, double share) {  // `share` of the way along h, which may turn against its curve
      const auto [curve, number] = place_[at(h)];
      const Index g = along(h);
      const double length = mesh_.edge_vector(g).norm();
      found.push_back({curve, curves_[at(curve)].begins[at(number)] + (g == h ? share : 1 - share) * length});
    };
    for (int i = 0; i < 3; ++i) {
      if (point.barycentric[i] < 1 - tolerance) continue;
      const Index v = mesh_.faces()(point.face, i);
      // Where the vertex is no corner, one place of the two will do: that where an edge begins there.
      for (const Index h : mesh_.around(v)) {
        if (marked(h) && (corner_[at(v)] || along(h) == h)) add(h, 0);
        if (!corner_[at(v)] && !found.empty()) return found;
        if (const Index in = mesh_.prev(h); mesh_.twin(in) == no_index && marked(in) && corner_[at(v)]) add(in, 1);
      }
      return found;
    }
    for (int i = 0; i < 3; ++i)
      if (const Index h = 3 * point.face + i; marked(h) && point.barycentric[(i + 2) % 3] <= tolerance) {
        add(h, point.barycentric[(i + 1) % 3]);
        return found;
      }
    return found;
  }

  [[nodiscard]] std::optional<Way> way_between(const SurfacePoint& from, const SurfacePoint& to,
                                               double tolerance = 0) const {
    std::optional<Way> best;
    const std::vector<Location> starts = locate(from, tolerance);
    if (starts.empty()) return best;
    for (const Location& b : locate(to, tolerance))
      for (const Location& a : starts) {
        if (a.curve != b.curve) continue;
        const Curve& curve = curves_[at(a.curve)];
        double way = b.along - a.along;
        if (curve.closed) {
          if (way <= 0) way += curve.length;
          if (!curve.border && way > curve.length / 2) way -= curve.length;
        }
        if (!best || std::abs(way) < std::abs(best->length)) best = Way{a.curve, a.along, way};
      }
    return best;
  }

  const TriangleMesh<double>& mesh_;
  std::vector<Curve> curves_;
  std::vector<std::array<Index, 2>> place_;  // curve and number in it, of each half-edge
  std::vector<char> corner_;
};

}  // namespace quadrig
