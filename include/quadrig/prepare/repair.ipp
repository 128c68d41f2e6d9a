// Welding, splitting, orienting and the removal of faces without area.
#pragma once

#include <numbers>
#include <set>

#include "quadrig/disjoint_sets.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/prepare/triangulate.ipp"

namespace quadrig::prepare_detail {

using Face = std::array<Index, 3>;

/// The mesh while it is repaired. Vertices are those of the input, then those made by splitting.
struct Draft {
  Points<double> positions;
  std::vector<Face> faces;
  std::vector<Index> polygon;                ///< per face
  std::vector<std::array<Index, 2>> source;  ///< per vertex: input vertex, and a second one for an inserted midpoint

  [[nodiscard]] Vector3 at(Index v) const { return positions.row(v).transpose(); }
  Index add_vertex(const Vector3& p, std::array<Index, 2> from) {
    const auto v = static_cast<Index>(source.size());
    if (v >= positions.rows()) positions.conservativeResize(std::max<Eigen::Index>(2 * positions.rows(), 16), 3);
    positions.row(v) = p.transpose();
    source.push_back(from);
    return v;
  }
};

/// One side of an undirected edge: half-edge 3 f + i runs from corner i of face f.
using Side = detail::SortedSide;
using detail::for_each_edge;

inline std::vector<Side> sorted_sides(const std::vector<Face>& faces) {
  Index vertices = 0;
  for (const Face& face : faces)
    for (const Index v : face) vertices = std::max(vertices, v + 1);
  return detail::sorted_by_edge(vertices, static_cast<Index>(3 * faces.size()), [&](Index h) {
    const Face& face = faces[static_cast<std::size_t>(h / 3)];
    const Index a = face[static_cast<std::size_t>(h % 3)], b = face[static_cast<std::size_t>((h % 3 + 1) % 3)];
    return Side::of(a, b, h);
  });
}

inline double diagonal(const Points<double>& positions) {
  if (positions.rows() == 0) return 0;
  return (positions.colwise().maxCoeff() - positions.colwise().minCoeff()).norm();
}

/// Joins vertices by `options.weld`, and the ends of edges without length; incomplete once cancelled.
inline DisjointSets weld(const Draft& work, const PrepareOptions& options, PrepareReport& report,
                         const Context& context) {
  const std::size_t n = work.source.size();
  DisjointSets groups(n);
  std::vector<char> used(n, 0), open(n, 0);
  for (const Face& face : work.faces)
    for (const Index v : face) used[static_cast<std::size_t>(v)] = 1;
  const double tiny = 1e-12 * diagonal(work.positions);
  for_each_edge(sorted_sides(work.faces), [&](std::span<const Side> edge) {
    const Index a = edge[0].low, b = edge[0].high;
    if (edge.size() == 1) open[static_cast<std::size_t>(a)] = open[static_cast<std::size_t>(b)] = 1;
    if (a != b && (work.at(a) - work.at(b)).norm() <= tiny && groups.join(a, b)) ++report.contracted_edges;
  });

  if (context.cancelled()) return groups;
  std::vector<Index> order;
  for (std::size_t v = 0; v < n; ++v)
    if (used[v]) order.push_back(static_cast<Index>(v));
  const auto key = [&](Index v) {
    const auto p = work.positions.row(v);
    return std::array{p[0], p[1], p[2]};
  };
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    const auto ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });
  if (context.cancelled()) return groups;
  const auto may_weld = [&](Index v) {
    return options.weld == Weld::all || (options.weld == Weld::seams && open[static_cast<std::size_t>(v)]);
  };
  for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
    while (last < order.size() && key(order[last]) == key(order[first])) ++last;
    report.doubled_vertices += static_cast<Index>(last - first - 1);
    Index target = no_index;
    for (std::size_t i = first; i < last; ++i) {
      if (!may_weld(order[i])) continue;
      if (target == no_index) target = order[i];
      if (groups.join(target, order[i])) ++report.welded_vertices;
    }
  }
  if (options.weld != Weld::never && options.weld_distance > 0) {
    // Along x only: the window holds few vertices for any sensible distance, and no cell number can overflow.
    const double reach = options.weld_distance;
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (!may_weld(order[i])) continue;
      for (std::size_t j = i + 1;
           j < order.size() && work.positions(order[j], 0) - work.positions(order[i], 0) <= reach; ++j)
        if (may_weld(order[j]) && (work.at(order[i]) - work.at(order[j])).norm() <= reach &&
            groups.join(order[i], order[j]))
          ++report.welded_vertices;
    }
  }
  return groups;
}

/// Names vertices by their groups; drops faces that repeat a vertex and faces that repeat a face.
inline void apply_groups(Draft& work, DisjointSets& groups, PrepareReport& report) {
  std::vector<std::pair<Face, std::size_t>> keys;
  for (std::size_t f = 0; f < work.faces.size(); ++f) {
    Face& face = work.faces[f];
    for (Index& v : face) v = groups.find(v);
    Face sorted = face;
    std::sort(sorted.begin(), sorted.end());
    if (sorted[0] == sorted[1] || sorted[1] == sorted[2])
      ++report.degenerate_faces;
    else
      keys.emplace_back(sorted, f);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<char> keep(work.faces.size(), 0);
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (k > 0 && keys[k].first == keys[k - 1].first)
      ++report.repeated_faces;
    else
      keep[keys[k].second] = 1;
  }
  std::size_t kept = 0;
  for (std::size_t f = 0; f < work.faces.size(); ++f) {
    if (!keep[f]) continue;
    work.faces[kept] = work.faces[f];
    work.polygon[kept++] = work.polygon[f];
  }
  work.faces.resize(kept);
  work.polygon.resize(kept);
}

/// Pairs the sides of an edge of three or more faces: where they alternate around it, those that bound the same
/// solid; else the flattest pair of opposite directions first, then the flattest.
inline void pair_around(const Draft& work, std::span<const Side> edge, std::vector<Index>& twin) {
  const Vector3 origin = work.at(edge[0].low);
  const Vector3 axis = (work.at(edge[0].high) - origin).normalized();
  const Vector3 x_axis = axis.unitOrthogonal(), y_axis = axis.cross(x_axis);
  struct Wing {
    double angle;
    Index halfedge;
    bool along;  ///< runs from low to high: the face's normal points to larger angles, its solid lies at smaller ones
  };
  std::vector<Wing> wings;
  for (const Side& side : edge) {
    const auto f = static_cast<std::size_t>(side.halfedge / 3), i = static_cast<std::size_t>(side.halfedge % 3);
    const Vector3 d = work.at(work.faces[f][(i + 2) % 3]) - origin;
    wings.push_back({elementary::atan2(d.dot(y_axis), d.dot(x_axis)), side.halfedge, work.faces[f][i] == side.low});
  }
  std::sort(wings.begin(), wings.end(), [](const Wing& a, const Wing& b) {
    return a.angle != b.angle ? a.angle < b.angle : a.halfedge < b.halfedge;
  });
  const auto join = [&](const Wing& a, const Wing& b) {
    twin[static_cast<std::size_t>(a.halfedge)] = b.halfedge;
    twin[static_cast<std::size_t>(b.halfedge)] = a.halfedge;
  };
  const std::size_t k = wings.size();
  bool alternating = k % 2 == 0;
  for (std::size_t i = 0; i < k; ++i) alternating = alternating && wings[i].along != wings[(i + 1) % k].along;
  if (alternating) {
    for (std::size_t i = 0; i < k; ++i)
      if (wings[i].along) join(wings[i], wings[(i + k - 1) % k]);
    return;
  }
  // So many faces on one edge bound nothing: each with the one that lies about opposite.
  if (constexpr std::size_t most = 64; k > most) {
    for (std::size_t i = 0; i < k / 2; ++i) join(wings[i], wings[i + k / 2]);
    return;
  }
  std::vector<char> taken(k, 0);
  for (std::size_t round = 0; round < k / 2; ++round) {
    std::size_t best_a = k, best_b = k;
    std::pair<bool, double> best{};
    for (std::size_t a = 0; a < k; ++a)
      for (std::size_t b = a + 1; b < k; ++b) {
        if (taken[a] || taken[b]) continue;
        const std::pair<bool, double> bend{wings[a].along == wings[b].along,
                                           std::abs(std::abs(wings[a].angle - wings[b].angle) - std::numbers::pi)};
        if (best_a == k || bend < best) best_a = a, best_b = b, best = bend;
      }
    taken[best_a] = taken[best_b] = 1;
    join(wings[best_a], wings[best_b]);
  }
}

/// Whether a point is inside a closed part: parity of the faces that a ray meets.
inline bool inside(const Draft& work, std::span<const Index> part, const Vector3& point) {
  const Vector3 ray = Vector3(0.5773, 0.5211, 0.6289).normalized();
  bool odd = false;
  for (const Index f : part) {
    const Face& face = work.faces[static_cast<std::size_t>(f)];
    const Vector3 a = work.at(face[0]) - point, b = work.at(face[1]) - point, c = work.at(face[2]) - point;
    const double u = ray.dot(a.cross(b)), v = ray.dot(b.cross(c)), w = ray.dot(c.cross(a));
    const bool hit = (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
    if (hit && a.dot((b - a).cross(c - a)) * (u + v + w) > 0) odd = !odd;
  }
  return odd;
}

/// Turns faces so that paired ones agree, cuts pairs that cannot, and turns whole parts outward.
inline void orient(Draft& work, std::vector<Index>& twin, const PrepareOptions& options, PrepareReport& report) {
  const std::size_t m = work.faces.size();
  std::vector<Index> part_of(m, no_index);
  std::vector<signed char> sign(m, 0);
  std::vector<std::vector<Index>> parts;
  const auto along = [&](Index h) {  // the undirected edge's direction along which the turned face runs
    const auto f = static_cast<std::size_t>(h / 3), i = static_cast<std::size_t>(h % 3);
    return (work.faces[f][i] < work.faces[f][(i + 1) % 3]) == (sign[f] > 0);
  };
  const auto cross = [&](Index f) {
    const Face& face = work.faces[static_cast<std::size_t>(f)];
    return triangle_normal(work.positions, face[0], face[1], face[2]);
  };
  for (std::size_t seed = 0; seed < m; ++seed) {
    if (part_of[seed] != no_index) continue;
    const auto part = static_cast<Index>(parts.size());
    std::vector<Index>& members = parts.emplace_back(1, static_cast<Index>(seed));
    part_of[seed] = part;
    sign[seed] = 1;
    for (std::size_t next = 0; next < members.size(); ++next)
      for (Index h = 3 * members[next]; h < 3 * members[next] + 3; ++h) {
        const Index g = twin[static_cast<std::size_t>(h)];
        if (g == no_index) continue;
        const auto f = static_cast<std::size_t>(g / 3);
        if (part_of[f] == no_index) {
          part_of[f] = part;
          sign[f] = 1;
          if (along(g) == along(h)) sign[f] = -1;
          members.push_back(static_cast<Index>(f));
        }
      }
  }
  for (Index h = 0; h < static_cast<Index>(3 * m); ++h) {
    const Index g = twin[static_cast<std::size_t>(h)];
    if (g == no_index || along(g) != along(h)) continue;
    twin[static_cast<std::size_t>(h)] = twin[static_cast<std::size_t>(g)] = no_index;
    ++report.twisted_edges;
  }
  std::vector<char> closed(parts.size(), 1);
  for (std::size_t h = 0; h < 3 * m; ++h)
    if (twin[h] == no_index) closed[static_cast<std::size_t>(part_of[h / 3])] = 0;
  const auto turn = [&](const std::vector<Index>& members) {
    for (const Index f : members)
      sign[static_cast<std::size_t>(f)] = static_cast<signed char>(-sign[static_cast<std::size_t>(f)]);
  };
  std::vector<std::pair<std::size_t, bool>> inward;  // closed parts of negative volume; true: all as in the input
  for (std::size_t p = 0; p < parts.size(); ++p) {
    double kept = 0, turned = 0, volume = 0;
    const Vector3 origin = work.at(work.faces[static_cast<std::size_t>(parts[p][0])][0]);
    for (const Index f : parts[p]) (sign[static_cast<std::size_t>(f)] > 0 ? kept : turned) += cross(f).norm();
    if (turned > kept) turn(parts[p]);
    if (!closed[p] || !options.orient_outward) continue;
    for (const Index f : parts[p])
      volume += sign[static_cast<std::size_t>(f)] *
                cross(f).dot(work.at(work.faces[static_cast<std::size_t>(f)][0]) - origin);
    if (volume < 0) inward.emplace_back(p, std::min(kept, turned) == 0);
  }
  if (!inward.empty()) {
    std::vector<Eigen::AlignedBox3d> boxes(parts.size());
    for (std::size_t p = 0; p < parts.size(); ++p)
      for (const Index f : parts[p])
        for (const Index v : work.faces[static_cast<std::size_t>(f)]) boxes[p].extend(work.at(v));
    for (const auto& [p, as_given] : inward) {
      bool cavity = false;
      const Vector3 point = work.at(work.faces[static_cast<std::size_t>(parts[p][0])][0]);
      for (std::size_t q = 0; as_given && q < parts.size(); ++q)
        if (q != p && closed[q] && boxes[q].contains(boxes[p]) && inside(work, parts[q], point)) cavity = !cavity;
      if (!cavity) turn(parts[p]);
    }
  }
  // Twins are renumbered with the corners that move: turning swaps corners 1 and 2, so sides 0 and 2.
  const auto moved = [&](Index h) {
    if (h == no_index || sign[static_cast<std::size_t>(h / 3)] > 0) return h;
    return h - h % 3 + 2 - h % 3;
  };
  std::vector<Index> turned_twin(twin.size());
  for (Index h = 0; h < static_cast<Index>(3 * m); ++h)
    turned_twin[static_cast<std::size_t>(moved(h))] = moved(twin[static_cast<std::size_t>(h)]);
  twin = std::move(turned_twin);
  for (std::size_t f = 0; f < m; ++f)
    if (sign[f] < 0) std::swap(work.faces[f][1], work.faces[f][2]), ++report.turned_faces;
  report.components = static_cast<Index>(parts.size());
  report.closed_components = static_cast<Index>(std::count(closed.begin(), closed.end(), 1));
}

/// Doubles vertices so that the faces around each, joined through twins, form one fan.
inline void split_fans(Draft& work, const std::vector<Index>& twin, PrepareReport& report) {
  DisjointSets fans(3 * work.faces.size());
  const auto vertex = [&](Index corner) -> Index& {
    return work.faces[static_cast<std::size_t>(corner / 3)][static_cast<std::size_t>(corner % 3)];
  };
  const auto next = [](Index h) { return h % 3 == 2 ? h - 2 : h + 1; };
  for (Index h = 0; h < static_cast<Index>(twin.size()); ++h) {
    const Index g = twin[static_cast<std::size_t>(h)];
    if (g == no_index || g < h) continue;
    fans.join(h, next(g));
    fans.join(next(h), g);
  }
  std::vector<Index> first_fan(work.source.size(), no_index), doubled(work.source.size(), 0);
  std::vector<Index> vertex_of_fan(twin.size(), no_index);
  for (Index corner = 0; corner < static_cast<Index>(twin.size()); ++corner) {
    const auto fan = static_cast<std::size_t>(fans.find(corner));
    const Index v = vertex(static_cast<Index>(fan));
    if (vertex_of_fan[fan] == no_index) {  // the fan's lowest corner comes first, and names the vertex
      if (first_fan[static_cast<std::size_t>(v)] == no_index) {
        first_fan[static_cast<std::size_t>(v)] = static_cast<Index>(fan);
        vertex_of_fan[fan] = v;
      } else {
        if (!std::exchange(doubled[static_cast<std::size_t>(v)], 1)) ++report.split_vertices;
        vertex_of_fan[fan] = work.add_vertex(work.at(v), work.source[static_cast<std::size_t>(v)]);
      }
    }
    vertex(corner) = vertex_of_fan[fan];
  }
}

/// Edges that still have more than two faces, or two of one direction, get a midpoint of their own for each pair.
/// Returns whether there were any.
inline bool part_edges(Draft& work, const std::vector<Index>& twin) {
  std::vector<char> touched(work.faces.size(), 0);
  bool any = false;
  const std::vector<Side> sides = sorted_sides(work.faces);
  for_each_edge(sides, [&](std::span<const Side> edge) {
    const auto runs_up = [&](const Side& side) {
      return work.faces[static_cast<std::size_t>(side.halfedge / 3)][static_cast<std::size_t>(side.halfedge % 3)] ==
             side.low;
    };
    if (edge.size() < 2 || (edge.size() == 2 && runs_up(edge[0]) != runs_up(edge[1]))) return;
    any = true;
    for (const Side& side : edge)
      if (touched[static_cast<std::size_t>(side.halfedge / 3)]) return;  // its turn comes in the next pass
    for (const Side& side : edge) {
      touched[static_cast<std::size_t>(side.halfedge / 3)] = 1;
      const Index g = twin[static_cast<std::size_t>(side.halfedge)];
      if (g != no_index && g < side.halfedge) continue;
      const Index a = edge[0].low, b = edge[0].high;
      const Index middle =
          work.add_vertex((work.at(a) + work.at(b)) / 2,
                          {work.source[static_cast<std::size_t>(a)][0], work.source[static_cast<std::size_t>(b)][0]});
      for (const Index h : {side.halfedge, g}) {
        if (h == no_index) continue;
        const auto f = static_cast<std::size_t>(h / 3), i = static_cast<std::size_t>(h % 3);
        Face other = work.faces[f];
        other[i] = middle;
        work.faces[f][(i + 1) % 3] = middle;
        work.faces.push_back(other);
        work.polygon.push_back(work.polygon[f]);
      }
    }
    touched.resize(work.faces.size(), 1);
  });
  return any;
}

/// Pairs, orients and splits until TriangleMesh's conditions hold, or until cancelled.
inline void make_manifold(Draft& work, const PrepareOptions& options, PrepareReport& report, const Context& context) {
  for (int pass = 0; pass < 100; ++pass) {
    std::vector<Index> twin(3 * work.faces.size(), no_index);
    PrepareReport ignored;
    PrepareReport& counts = pass == 0 ? report : ignored;
    for_each_edge(sorted_sides(work.faces), [&](std::span<const Side> edge) {
      if (edge.size() == 2) {
        twin[static_cast<std::size_t>(edge[0].halfedge)] = edge[1].halfedge;
        twin[static_cast<std::size_t>(edge[1].halfedge)] = edge[0].halfedge;
      } else if (edge.size() > 2) {
        ++counts.split_edges;
        pair_around(work, edge, twin);
      }
    });
    if (context.cancelled()) return;
    orient(work, twin, options, counts);
    if (context.cancelled()) return;
    split_fans(work, twin, counts);
    if (context.cancelled()) return;
    report.components = counts.components;
    report.closed_components = counts.closed_components;
    if (!part_edges(work, twin)) return;
  }
}

/// Height over the longest edge; 0 for a face without length. `longest` gets that edge's corner.
inline double flatness(const Draft& work, const Face& face, std::size_t* longest = nullptr) {
  double best = -1;
  for (std::size_t i = 0; i < 3; ++i) {
    const double length = (work.at(face[(i + 1) % 3]) - work.at(face[i])).squaredNorm();
    if (length > best) {
      best = length;
      if (longest) *longest = i;
    }
  }
  return best > 0 ? triangle_normal(work.positions, face[0], face[1], face[2]).norm() / best : 0;
}

/// Removes faces without area: the longest edge is flipped, so that the neighbour takes over; at an open edge the face
/// goes. What no flip repairs is joined to the nearer end in `groups`. \pre manifold. Returns whether it changed faces.
inline bool remove_flat_faces(Draft& work, double ratio, DisjointSets& groups, PrepareReport& report) {
  bool changed = false;
  for (int round = 0; round < 8; ++round) {
    std::vector<Index> flat;
    for (std::size_t f = 0; f < work.faces.size(); ++f)
      if (flatness(work, work.faces[f]) <= ratio) flat.push_back(static_cast<Index>(f));
    if (flat.empty()) return changed;
    const std::vector<Side> sides = sorted_sides(work.faces);
    const auto sides_of = [&](Index a, Index b) {
      const Side wanted{std::min(a, b), std::max(a, b), 0};
      return std::equal_range(sides.begin(), sides.end(), wanted, [](const Side& x, const Side& y) {
        return std::array{x.low, x.high} < std::array{y.low, y.high};
      });
    };
    std::vector<char> touched(work.faces.size(), 0), gone(work.faces.size(), 0);
    std::vector<char> is_flat(work.faces.size(), 0);
    for (const Index f : flat) is_flat[static_cast<std::size_t>(f)] = 1;
    std::set<std::array<Index, 2>> made;
    bool flipped = false;
    for (const Index f : flat) {
      const auto here = static_cast<std::size_t>(f);
      if (touched[here]) continue;
      std::size_t i = 0;
      const double before = flatness(work, work.faces[here], &i);
      const Index a = work.faces[here][i], b = work.faces[here][(i + 1) % 3], c = work.faces[here][(i + 2) % 3];
      const auto [first, last] = sides_of(a, b);
      if (last - first == 1) {
        gone[here] = touched[here] = 1;
        flipped = true;
        continue;
      }
      if (last - first != 2) continue;
      const Index g = first->halfedge / 3 == f ? (first + 1)->halfedge : first->halfedge;
      const auto there = static_cast<std::size_t>(g / 3);
      if (touched[there]) continue;
      const Index d = work.faces[there][static_cast<std::size_t>((g % 3 + 2) % 3)];
      const std::array<Index, 2> edge{std::min(c, d), std::max(c, d)};
      const auto [cd_first, cd_last] = sides_of(c, d);
      if (c == d || cd_first != cd_last || made.contains(edge)) continue;
      const Face left{a, d, c}, right{d, b, c};
      if (std::min(flatness(work, left), flatness(work, right)) <= before) continue;
      work.faces[here] = left;
      work.faces[there] = right;
      touched[here] = touched[there] = 1;
      made.insert(edge);
      flipped = true;
    }
    if (!flipped) {
      for (const Index f : flat) {
        std::size_t i = 0;
        const Face face = work.faces[static_cast<std::size_t>(f)];
        flatness(work, face, &i);
        const Index a = face[i], b = face[(i + 1) % 3], c = face[(i + 2) % 3];
        groups.join((work.at(a) - work.at(c)).norm() <= (work.at(b) - work.at(c)).norm() ? a : b, c);
        ++report.flat_faces;
      }
      return true;
    }
    changed = true;
    std::size_t kept = 0;
    for (std::size_t f = 0; f < work.faces.size(); ++f) {
      if (touched[f] && is_flat[f]) ++report.flat_faces;
      if (gone[f]) continue;
      work.faces[kept] = work.faces[f];
      work.polygon[kept++] = work.polygon[f];
    }
    work.faces.resize(kept);
    work.polygon.resize(kept);
  }
  return changed;
}

}  // namespace quadrig::prepare_detail
