// Closest points on a triangle surface: a box tree for the whole surface, and a walk that stays on one sheet of it.
#pragma once

#include <limits>

#include "quadrig/mesh.hpp"

namespace quadrig {

/// A point of a surface found from a point in space.
struct SurfaceHit : SurfacePoint {
  Vector3 position = Vector3::Zero();
  double squared_distance = std::numeric_limits<double>::infinity();
  [[nodiscard]] bool found() const { return face != no_index; }
};

/// Point of the triangle a b c closest to p, with `face` left unset. A triangle without area counts as its edges.
/// \cost O(1). \fails never. Source: Ericson, Real-Time Collision Detection, 5.1.5.
[[nodiscard]] SurfaceHit closest_on_triangle(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c);

/// Which points of the surface a query may return.
struct ClosestFilter {
  /// Faces whose normal makes a smaller cosine than `minimum_cosine` with this vector are passed over: the far side of
  /// a thin part never answers. Zero: every face may answer. Needs no unit length.
  Vector3 normal = Vector3::Zero();
  double minimum_cosine = 0;
  /// Nothing farther than this answers.
  double maximum_distance = std::numeric_limits<double>::infinity();
};

/// Answers closest-point queries over a fixed triangle surface. Keeps its own copy of what it needs; queries are
/// const and may run on any number of threads. Of equally close faces the one with the lowest number answers.
class ClosestPoint {
 public:
  ClosestPoint() = default;
  /// \cost O(m log m) time, about 140 m bytes. \fails never.
  explicit ClosestPoint(const TriangleMesh<double>& mesh) : ClosestPoint(mesh.positions(), mesh.faces()) {}
  /// Any triangle soup: m×3 faces over n×3 positions. \pre indices in range, positions finite
  ClosestPoint(const Points<double>& positions, const Triangles& faces);
  template <class V, class F>
  requires(RuntimeColumns<V> || RuntimeColumns<F>) ClosestPoint(const V&, const F&)
  = delete;  // see with_columns

  [[nodiscard]] bool empty() const { return nodes_.empty(); }

  /// The closest point of the surface. Not found() only on an empty surface. \cost O(log m) for points near the
  /// surface.
  [[nodiscard]] SurfaceHit closest(const Vector3& p) const { return search<false>(p, {}); }
  /// The closest point among those the filter admits; not found() when there is none.
  [[nodiscard]] SurfaceHit closest(const Vector3& p, const ClosestFilter& filter) const {
    return filter.normal.squaredNorm() > 0 ? search<true>(p, filter) : search<false>(p, filter);
  }

  /// Whether a ray meets the surface farther than `beyond` times `direction` from its origin.
  /// \cost O(log m) for most rays. Source: Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection.
  [[nodiscard]] bool meets(const Vector3& origin, const Vector3& direction, double beyond) const;

 private:
  struct Box {
    Vector3 low, high;
    [[nodiscard]] double squared_distance(const Vector3& p) const {
      return (low - p).cwiseMax(p - high).cwiseMax(0.0).squaredNorm();
    }
  };
  /// An inner node's first child follows it, the second is `second`; a leaf holds triangles [first, first + count).
  struct Node {
    Box box;
    Index second = 0;
    Index first = 0, count = 0;
  };
  struct Corner3 {
    Vector3 a, b, c;
    Index face;
  };
  static constexpr Index leaf_size = 8;

  template <bool filtered>
  [[nodiscard]] SurfaceHit search(const Vector3& p, const ClosestFilter& filter) const;

  std::vector<Node> nodes_;         // preorder
  std::vector<Corner3> triangles_;  // in leaf order
};

/// Follows the surface from `start` towards p as long as a face that shares a corner comes closer: a local minimum of
/// the distance, on the sheet where it began. `start` should be near the answer; it never jumps across a thin part.
/// \pre start.face is a face of the mesh. \cost O(faces walked over). \fails never.
[[nodiscard]] SurfaceHit walk_closest(const TriangleMesh<double>& mesh, const Vector3& p, const SurfacePoint& start);

// Definitions ------------------------------------------------------------------------------------------------------

inline SurfaceHit closest_on_triangle(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c) {
  SurfaceHit hit;
  const auto answer = [&](double u, double v, double w) {
    hit.barycentric = {u, v, w};
    hit.position = u * a + v * b + w * c;
    hit.squared_distance = (hit.position - p).squaredNorm();
    return hit;
  };
  const Vector3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  const double sum = va + vb + vc;  // |ab × ac|²
  const double ab2 = ab.squaredNorm(), ac2 = ac.squaredNorm(), ab_ac = ab.dot(ac);
  if (ab2 * ac2 - ab_ac * ab_ac < 1e-8 * ab2 * ac2 || ab2 == 0 || ac2 == 0) {
    // A needle: the signs below would be noise, so the best of its edges and its inside is taken.
    SurfaceHit best;
    const Vector3* corner[3] = {&a, &b, &c};
    for (int i = 0; i < 3; ++i) {
      const Vector3 &from = *corner[i], &to = *corner[(i + 1) % 3];
      const double length = (to - from).squaredNorm();
      const double t = length > 0 ? std::clamp((to - from).dot(p - from) / length, 0.0, 1.0) : 0.0;
      Vector3 barycentric = Vector3::Zero();
      barycentric[i] = 1 - t;
      barycentric[(i + 1) % 3] = t;
      const SurfaceHit edge = answer(barycentric[0], barycentric[1], barycentric[2]);
      if (edge.squared_distance < best.squared_distance) best = edge;
    }
    if (va >= 0 && vb >= 0 && vc >= 0 && sum > 0) {
      const SurfaceHit inside = answer(va / sum, vb / sum, vc / sum);
      if (inside.squared_distance < best.squared_distance) best = inside;
    }
    return best;
  }
  if (d1 <= 0 && d2 <= 0) return answer(1, 0, 0);
  if (d3 >= 0 && d4 <= d3) return answer(0, 1, 0);
  if (d6 >= 0 && d5 <= d6) return answer(0, 0, 1);
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double t = d1 / (d1 - d3);
    return answer(1 - t, t, 0);
  }
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double t = d2 / (d2 - d6);
    return answer(1 - t, 0, t);
  }
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return answer(0, 1 - t, t);
  }
  const double u = std::max(va, 0.0), v = std::max(vb, 0.0), w = std::max(vc, 0.0), total = u + v + w;
  return answer(u / total, v / total, w / total);
}

inline ClosestPoint::ClosestPoint(const Points<double>& positions, const Triangles& faces) {
  const Index m = static_cast<Index>(faces.rows());
  if (m == 0) return;
  triangles_.resize(static_cast<std::size_t>(m));
  std::vector<Vector3> centres(static_cast<std::size_t>(m));
  std::vector<Index> order(static_cast<std::size_t>(m));
  for (Index f = 0; f < m; ++f) {
    order[static_cast<std::size_t>(f)] = f;
    centres[static_cast<std::size_t>(f)] =
        (positions.row(faces(f, 0)) + positions.row(faces(f, 1)) + positions.row(faces(f, 2))).transpose() / 3;
  }
  struct Task {
    Index first, last;
    Index parent;  // whose second child this is, or no_index
  };
  nodes_.reserve(static_cast<std::size_t>(m));
  std::vector<Task> tasks{{0, m, no_index}};
  while (!tasks.empty()) {
    const Task task = tasks.back();
    tasks.pop_back();
    const Index id = static_cast<Index>(nodes_.size());
    if (task.parent != no_index) nodes_[static_cast<std::size_t>(task.parent)].second = id;
    Node node;
    node.box.low.setConstant(std::numeric_limits<double>::infinity());
    node.box.high = -node.box.low;
    Box spread = node.box;
    for (Index k = task.first; k < task.last; ++k) {
      const Index f = order[static_cast<std::size_t>(k)];
      for (int i = 0; i < 3; ++i) {
        const Vector3 q = positions.row(faces(f, i)).transpose();
        node.box.low = node.box.low.cwiseMin(q);
        node.box.high = node.box.high.cwiseMax(q);
      }
      spread.low = spread.low.cwiseMin(centres[static_cast<std::size_t>(f)]);
      spread.high = spread.high.cwiseMax(centres[static_cast<std::size_t>(f)]);
    }
    if (task.last - task.first <= leaf_size) {
      node.first = task.first;
      node.count = task.last - task.first;
    } else {
      int axis = 0;
      (spread.high - spread.low).maxCoeff(&axis);
      const Index middle = task.first + (task.last - task.first) / 2;
      std::nth_element(order.begin() + task.first, order.begin() + middle, order.begin() + task.last,
                       [&](Index f, Index g) {
                         const double x = centres[static_cast<std::size_t>(f)][axis];
                         const double y = centres[static_cast<std::size_t>(g)][axis];
                         return x != y ? x < y : f < g;
                       });
      tasks.push_back({middle, task.last, id});
      tasks.push_back({task.first, middle, no_index});  // popped next, so that it follows its parent
    }
    nodes_.push_back(node);
  }
  for (Index k = 0; k < m; ++k) {
    const Index f = order[static_cast<std::size_t>(k)];
    triangles_[static_cast<std::size_t>(k)] = {positions.row(faces(f, 0)).transpose(),
                                               positions.row(faces(f, 1)).transpose(),
                                               positions.row(faces(f, 2)).transpose(), f};
  }
}

template <bool filtered>
SurfaceHit ClosestPoint::search(const Vector3& p, const ClosestFilter& filter) const {
  SurfaceHit best;
  if (nodes_.empty()) return best;
  best.squared_distance = filter.maximum_distance * filter.maximum_distance;
  const double normal_length = filtered ? filter.normal.norm() : 0;
  struct Entry {
    Index node;
    double squared_distance;
  };
  Entry stack[64];  // halving 2^31 faces goes 30 deep, one waiting sibling a level
  int depth = 0;
  stack[depth++] = {0, nodes_[0].box.squared_distance(p)};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.squared_distance > best.squared_distance) continue;
    Index id = entry.node;
    for (;;) {
      const Node& node = nodes_[static_cast<std::size_t>(id)];
      if (node.count > 0) {
        for (Index k = node.first; k < node.first + node.count; ++k) {
          const Corner3& t = triangles_[static_cast<std::size_t>(k)];
          if constexpr (filtered) {
            const Vector3 cross = (t.b - t.a).cross(t.c - t.a);
            if (!(cross.dot(filter.normal) >= filter.minimum_cosine * cross.norm() * normal_length)) continue;
          }
          SurfaceHit hit = closest_on_triangle(p, t.a, t.b, t.c);
          hit.face = t.face;
          if (hit.squared_distance < best.squared_distance ||
              (hit.squared_distance == best.squared_distance && (!best.found() || hit.face < best.face)))
            best = hit;
        }
        break;
      }
      const Index left = id + 1, right = node.second;
      const double to_left = nodes_[static_cast<std::size_t>(left)].box.squared_distance(p);
      const double to_right = nodes_[static_cast<std::size_t>(right)].box.squared_distance(p);
      const bool left_first = to_left <= to_right;
      const double nearer = left_first ? to_left : to_right, farther = left_first ? to_right : to_left;
      if (farther <= best.squared_distance) stack[depth++] = {left_first ? right : left, farther};
      if (nearer > best.squared_distance) break;
      id = left_first ? left : right;
    }
  }
  return best;
}

inline bool ClosestPoint::meets(const Vector3& origin, const Vector3& direction, double beyond) const {
  if (nodes_.empty()) return false;
  const Vector3 inverse = direction.cwiseInverse();
  const auto through = [&](const Box& box) {
    double from = beyond, to = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
      if (direction[i] == 0) {
        if (origin[i] < box.low[i] || origin[i] > box.high[i]) return false;
        continue;
      }
      const double a = (box.low[i] - origin[i]) * inverse[i], b = (box.high[i] - origin[i]) * inverse[i];
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    }
    return from <= to;
  };
  const auto hit = [&](const Corner3& t) {
    const Vector3 ab = t.b - t.a, ac = t.c - t.a, p = direction.cross(ac), q = origin - t.a;
    const double determinant = ab.dot(p);
    if (determinant == 0) return false;
    const double u = q.dot(p) / determinant;
    if (!(u >= 0 && u <= 1)) return false;
    const Vector3 r = q.cross(ab);
    const double v = direction.dot(r) / determinant;
    return v >= 0 && u + v <= 1 && ac.dot(r) / determinant > beyond;
  };
  Index stack[64];  // as in `search`
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    Index id = stack[--depth];
    if (!through(nodes_[static_cast<std::size_t>(id)].box)) continue;
    for (;;) {
      const Node& node = nodes_[static_cast<std::size_t>(id)];
      if (node.count > 0) {
        for (Index k = node.first; k < node.first + node.count; ++k)
          if (hit(triangles_[static_cast<std::size_t>(k)])) return true;
        break;
      }
      const bool left = through(nodes_[static_cast<std::size_t>(id + 1)].box),
                 right = through(nodes_[static_cast<std::size_t>(node.second)].box);
      if (!left && !right) break;
      if (left && right) stack[depth++] = node.second;
      id = left ? id + 1 : node.second;
    }
  }
  return false;
}

inline SurfaceHit walk_closest(const TriangleMesh<double>& mesh, const Vector3& p, const SurfacePoint& start) {
  const auto on_face = [&](Index f) {
    SurfaceHit hit = closest_on_triangle(p, mesh.position(mesh.faces()(f, 0)), mesh.position(mesh.faces()(f, 1)),
                                         mesh.position(mesh.faces()(f, 2)));
    hit.face = f;
    return hit;
  };
  SurfaceHit best = on_face(start.face);
  constexpr int most_around = 256, most_beside = 32;
  for (;;) {
    const Index centre = best.face;
    const auto look_at = [&](Index h) {
      if (h / 3 == centre) return;
      const SurfaceHit hit = on_face(h / 3);
      if (hit.squared_distance < best.squared_distance) best = hit;
    };
    for (int i = 0; i < 3; ++i) {
      const Index first = mesh.outgoing(mesh.faces()(centre, i));
      int count = 0;
      for (Index h = first; h != no_index && count < most_around; ++count) {
        look_at(h);
        h = mesh.next_around(h);
        if (h == first) break;
      }
      if (count < most_around) continue;
      // Of a fan that wide those beside the centre: the walk goes around it in steps.
      Index h = 3 * centre + i;
      for (int k = 0; k < most_beside && (h = mesh.next_around(h)) != no_index; ++k) look_at(h);
      h = 3 * centre + i;
      for (int k = 0; k < most_beside && (h = mesh.twin(h)) != no_index; ++k)
        look_at(h = TriangleMesh<double>::next(h));
    }
    if (best.face == centre) return best;  // the distance falls with every step, so no face is the centre twice
  }
}

}  // namespace quadrig
