// Pairs of triangles.
#include "polygons.hpp"

#include <algorithm>
#include <map>
#include <optional>

#include "quadrig/quads.hpp"

namespace quadrig::gltf {

Index triangle_count(std::span<const Polygon> polygons) {
  Index count = 0;
  for (const Polygon& p : polygons) count += static_cast<Index>(p.size()) - 2;
  return count;
}

int first_corner(const std::array<Vector3, 4>& p) {
  const auto fold = [&](std::size_t i) {
    const Vector3 &a = p[i], &b = p[(i + 1) % 4], &c = p[(i + 2) % 4], &d = p[(i + 3) % 4];
    return (b - a).cross(c - a).dot((c - a).cross(d - a)) <= 0;
  };
  if (fold(0) != fold(1)) return fold(0) ? 1 : 0;
  return (p[0] - p[2]).squaredNorm() <= (p[1] - p[3]).squaredNorm() ? 0 : 1;
}

namespace {

/// First column of the normals of a primitive, or -1.
Eigen::Index normal_column(const Gathered& gathered, Index primitive) {
  for (const std::size_t a : gathered.primitives[at(primitive)].attributes) {
    const Attribute& attribute = gathered.attributes[a];
    if (attribute.target == Attribute::no_target && attribute.name == "NORMAL" && attribute.width == 3)
      return attribute.first;
  }
  return -1;
}

}  // namespace

std::optional<Vector3> Wedges::normal(Index wedge, Index primitive) const {
  const Eigen::Index column = normal_column(gathered_, primitive);
  if (column < 0) return std::nullopt;
  const Vector3 n = gathered_.values.row(wedge).segment<3>(column).transpose();
  const double length = n.norm();
  if (!(length > 0 && std::isfinite(length))) return std::nullopt;
  return Vector3(n / length);
}

bool Wedges::is_hard(Index halfedge) const {
  const TriangleMesh<double>& mesh = gathered_.surface.asset.mesh;
  const Index across = mesh.twin(halfedge);
  if (across == no_index) return false;
  const auto part = [&](Index a, Index b) {
    const auto own = [&](Index c) {
      return normal(gathered_.corner_vertex[at(c)], gathered_.surface.source_primitive[at(c / 3)]);
    };
    const auto n = own(a), m = own(b);
    return n && m && !(n->dot(*m) > hard_cosine);
  };
  return part(halfedge, TriangleMesh<double>::next(across)) || part(TriangleMesh<double>::next(halfedge), across);
}

bool Wedges::joined(Index a, Index b) const {
  for (const Eigen::Index k : columns_)
    if (!(std::abs(gathered_.values(a, k) - gathered_.values(b, k)) <= 1e-5)) return false;
  return true;
}

double Wedges::difference(Index a, Index b, Index primitive) const {
  double sum = 0;
  for (const Eigen::Index k : columns_) sum += std::abs(gathered_.values(a, k) - gathered_.values(b, k));
  const auto n = normal(a, primitive), m = normal(b, primitive);
  return sum + (n && m ? 0.25 * (1 - n->dot(*m)) : 0.0);
}

Wedges::Wedges(const Gathered& gathered, const Components& shells) : gathered_(gathered) {
  const TriangleMesh<double>& mesh = gathered.surface.asset.mesh;
  for (const Attribute& a : gathered.attributes)
    if (a.makes_seams())
      for (Eigen::Index k = 0; k < a.width; ++k) columns_.push_back(a.first + k);
  const auto primitive_of = [&](Index f) { return gathered.surface.source_primitive[at(f)]; };
  // A shell is flat where nearly all triangles beside an edge that bends have one normal, about their own: that of a
  // polygon that is not quite flat is a little off those of its triangles. Without normals they are drawn flat.
  constexpr double alike_cosine = 0.9999, about = 0.8, nearly_all = 0.9;
  std::vector<Index> beside(at(shells.count), 0), even(at(shells.count), 0);
  const auto own_normal = [&](Index corner) {
    return normal(gathered.corner_vertex[at(corner)], primitive_of(corner / 3));
  };
  const auto bends = [&](Index h) {
    const Index across = mesh.twin(h);
    return across != no_index && mesh.normal(h / 3).dot(mesh.normal(across / 3)) < 0.999;
  };
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (!bends(3 * f) && !bends(3 * f + 1) && !bends(3 * f + 2)) continue;
    const Index shell = shells.of_face[at(f)];
    ++beside[at(shell)];
    const auto a = own_normal(3 * f), b = own_normal(3 * f + 1), c = own_normal(3 * f + 2);
    if (a && b && c)
      even[at(shell)] += a->dot(*b) > alike_cosine && b->dot(*c) > alike_cosine && a->dot(mesh.normal(f)) > about;
    else
      even[at(shell)] += !a && !b && !c;
  }
  for (std::size_t s = 0; s < beside.size(); ++s)
    flat_.push_back(beside[s] > 0 && static_cast<double>(even[s]) >= nearly_all * static_cast<double>(beside[s]));

  std::vector<std::vector<Index>> known(at(mesh.vertex_count()));  // corners that stand for a wedge
  of_corner_.resize(at(mesh.halfedge_count()));
  for (Index corner = 0; corner < mesh.halfedge_count(); ++corner) {
    const Index f = corner / 3, own = gathered.corner_vertex[at(corner)];
    const bool flat = flat_[at(shells.of_face[at(f)])];
    std::vector<Index>& there = known[at(mesh.origin(corner))];
    const auto alike = [&](Index other) {
      const Index theirs = gathered.corner_vertex[at(other)];
      if (theirs == own) return true;
      if (primitive_of(other / 3) != primitive_of(f) || !joined(own, theirs)) return false;
      if (flat) return true;
      const auto a = own_normal(corner), b = own_normal(other);
      return !a || !b || a->dot(*b) > hard_cosine;
    };
    const auto same = std::find_if(there.begin(), there.end(), alike);
    const Index stands_for = same == there.end() ? corner : *same;
    if (stands_for == corner) there.push_back(corner);
    of_corner_[at(corner)] = gathered.corner_vertex[at(stands_for)];
  }
}

std::vector<Polygon> triangles_of(const Gathered& gathered, const Wedges& wedges, std::span<const Index> faces) {
  std::vector<Polygon> list;
  list.reserve(faces.size());
  for (const Index f : faces) {
    Polygon& polygon = list.emplace_back();
    for (int i = 0; i < 3; ++i) {
      polygon.vertex[static_cast<std::size_t>(i)] = gathered.surface.asset.mesh.faces()(f, i);
      polygon.wedge[static_cast<std::size_t>(i)] = wedges.at_corner(3 * f + i);
      polygon.own[0][static_cast<std::size_t>(i)] = gathered.corner_vertex[at(3 * f + i)];
    }
    polygon.primitive = gathered.surface.source_primitive[at(f)];
  }
  return list;
}

namespace {

/// A matching of triangles, heaviest pairs first, then longer by alternating paths.
class Matcher {
  static constexpr double least_jacobian = 0.05, least_cosine = 0.3;
  static constexpr double neighbours_in_file = 0.6;  // what following each other is worth, in scaled Jacobian

 public:
  Matcher(const Points<double>& positions, std::vector<Polygon> triangles, std::span<const Index> order)
      : positions_(positions), triangles_(std::move(triangles)), order_(order) {
    find_pairs();
    std::vector<Index> by_weight(pairs_.size());
    for (std::size_t e = 0; e < pairs_.size(); ++e) by_weight[e] = static_cast<Index>(e);
    std::stable_sort(by_weight.begin(), by_weight.end(),
                     [&](Index a, Index b) { return pairs_[at(a)].weight > pairs_[at(b)].weight; });
    for (const Index e : by_weight)
      if (mate_[at(pairs_[at(e)].f)] == no_index && mate_[at(pairs_[at(e)].g)] == no_index && allowed(e)) add(e);
    augment();
  }

  [[nodiscard]] std::vector<Polygon> polygons() const {
    std::vector<Polygon> result;
    for (std::size_t f = 0; f < triangles_.size(); ++f) {
      const Index e = mate_[f];
      if (e == no_index)
        result.push_back(triangles_[f]);
      else if (at(pairs_[at(e)].f) == f)
        result.push_back(pairs_[at(e)].quad);
    }
    return result;
  }

 private:
  struct Pair {
    Index f, g;
    Polygon quad;  // corners 0 and 2 are the ends of the edge that goes
    double weight;
  };

  [[nodiscard]] Vector3 point(Index v) const { return positions_.row(v).transpose(); }
  [[nodiscard]] Vector3 normal(const Polygon& t) const {
    return (point(t.vertex[1]) - point(t.vertex[0])).cross(point(t.vertex[2]) - point(t.vertex[0])).normalized();
  }

  void find_pairs() {
    struct Side {
      Index low, high, face;
      std::size_t corner;
    };
    std::vector<Side> sides;
    for (std::size_t f = 0; f < triangles_.size(); ++f)
      for (std::size_t i = 0; i < 3; ++i) {
        const auto [low, high] = std::minmax(triangles_[f].vertex[i], triangles_[f].vertex[(i + 1) % 3]);
        sides.push_back({low, high, static_cast<Index>(f), i});
      }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
      return std::array{a.low, a.high, a.face} < std::array{b.low, b.high, b.face};
    });
    mate_.assign(triangles_.size(), no_index);
    incident_.resize(triangles_.size());
    for (std::size_t s = 0; s < sides.size(); ++s) {
      const bool twins = s + 1 < sides.size() && sides[s].low == sides[s + 1].low && sides[s].high == sides[s + 1].high;
      degree_[sides[s].low] += twins ? 1 : 2;  // the border counts as half a turn more
      degree_[sides[s].high] += twins ? 1 : 2;
      if (!twins) continue;
      const Side &a = sides[s], &b = sides[s + 1];
      ++s;
      const Polygon &f = triangles_[at(a.face)], &g = triangles_[at(b.face)];
      const std::size_t i = a.corner, j = b.corner;
      if (f.primitive != g.primitive || f.wedge[i] != g.wedge[(j + 1) % 3] || f.wedge[(i + 1) % 3] != g.wedge[j])
        continue;
      if (f.vertex[(i + 2) % 3] == g.vertex[(j + 2) % 3]) continue;
      Polygon quad;
      quad.primitive = f.primitive;
      quad.vertex = {f.vertex[i], g.vertex[(j + 2) % 3], f.vertex[(i + 1) % 3], f.vertex[(i + 2) % 3]};
      quad.wedge = {f.wedge[i], g.wedge[(j + 2) % 3], f.wedge[(i + 1) % 3], f.wedge[(i + 2) % 3]};
      quad.own = {{{g.own[0][(j + 1) % 3], g.own[0][(j + 2) % 3], g.own[0][j]},
                   {f.own[0][i], f.own[0][(i + 1) % 3], f.own[0][(i + 2) % 3]}}};
      const double bend = normal(f).dot(normal(g));
      if (!(bend > least_cosine)) continue;
      const double jacobian = scaled_jacobian(
          positions_, Eigen::Matrix<Index, 1, 4>(quad.vertex[0], quad.vertex[1], quad.vertex[2], quad.vertex[3]));
      if (!(jacobian > least_jacobian)) continue;
      double weight = jacobian + bend;
      if (!order_.empty() && std::abs(order_[at(a.face)] - order_[at(b.face)]) == 1) weight += neighbours_in_file;
      const auto e = static_cast<Index>(pairs_.size());
      pairs_.push_back({a.face, b.face, quad, weight});
      incident_[at(a.face)].push_back(e);
      incident_[at(b.face)].push_back(e);
    }
  }

  /// A vertex inside keeps three edges: two quads around one cannot both be valid.
  [[nodiscard]] bool allowed(Index e) const {
    const Polygon& quad = pairs_[at(e)].quad;
    return degree_.at(quad.vertex[0]) > 3 && degree_.at(quad.vertex[2]) > 3;
  }
  void count(Index e, Index change) {
    degree_[pairs_[at(e)].quad.vertex[0]] += change;
    degree_[pairs_[at(e)].quad.vertex[2]] += change;
    mate_[at(pairs_[at(e)].f)] = mate_[at(pairs_[at(e)].g)] = change < 0 ? e : no_index;
  }
  void add(Index e) { count(e, -1); }
  void remove(Index e) { count(e, 1); }
  [[nodiscard]] Index other(Index e, Index f) const { return pairs_[at(e)].f == f ? pairs_[at(e)].g : pairs_[at(e)].f; }

  /// Breadth first from each single triangle; short paths are found, blossoms passed over.
  void augment() {
    constexpr std::size_t reach = 100;
    std::vector<Index> from(triangles_.size(), no_index), seen(triangles_.size(), no_index), queue;
    for (Index root = 0; root < static_cast<Index>(triangles_.size()); ++root) {
      if (mate_[at(root)] != no_index) continue;
      queue.assign(1, root);
      seen[at(root)] = root;
      bool done = false;
      for (std::size_t next = 0; next < queue.size() && next < reach && !done; ++next)
        for (const Index e : incident_[at(queue[next])]) {
          const Index g = other(e, queue[next]);
          if (seen[at(g)] == root) continue;
          seen[at(g)] = root;
          from[at(g)] = e;
          if (mate_[at(g)] == no_index) {
            if ((done = swap_along(root, g, from))) break;
            continue;
          }
          const Index beyond = other(mate_[at(g)], g);
          if (seen[at(beyond)] == root) continue;
          seen[at(beyond)] = root;
          queue.push_back(beyond);
        }
    }
  }

  bool swap_along(Index root, Index end, const std::vector<Index>& from) {
    std::vector<Index> joined, parted;
    for (Index g = end;;) {
      const Index e = from[at(g)];
      joined.push_back(e);
      const Index f = other(e, g);
      if (f == root) break;
      parted.push_back(mate_[at(f)]);
      g = other(mate_[at(f)], f);
    }
    for (const Index e : parted) remove(e);
    for (std::size_t k = 0; k < joined.size(); ++k) {
      if (allowed(joined[k])) {
        add(joined[k]);
        continue;
      }
      while (k-- > 0) remove(joined[k]);
      for (const Index e : parted) add(e);
      return false;
    }
    return true;
  }

  const Points<double>& positions_;
  std::vector<Polygon> triangles_;
  std::span<const Index> order_;
  std::vector<Pair> pairs_;
  std::vector<std::vector<Index>> incident_;  // pairs that each triangle could be in
  std::vector<Index> mate_;                   // the pair that it is in
  std::map<Index, Index> degree_;             // edges of each vertex that are left
};

}  // namespace

std::vector<Polygon> paired(const Points<double>& positions, std::vector<Polygon> triangles,
                            std::span<const Index> order) {
  return Matcher(positions, std::move(triangles), order).polygons();
}

double irregular_share(std::span<const Polygon> polygons, Index& irregular) {
  std::map<Index, std::pair<Index, Index>> around;  // polygons of each vertex, and sides that are a border
  std::map<std::pair<Index, Index>, Index> sides;
  for (const Polygon& p : polygons)
    for (std::size_t i = 0; i < p.size(); ++i) {
      ++around[p.vertex[i]].first;
      ++sides[std::minmax(p.vertex[i], p.vertex[(i + 1) % p.size()])];
    }
  for (const auto& [side, count] : sides)
    if (count == 1) ++around[side.first].second, ++around[side.second].second;
  Index inside = 0;
  irregular = 0;
  for (const auto& [v, count] : around)
    if (count.second == 0) {
      ++inside;
      irregular += count.first != 4;
    }
  return inside > 0 ? static_cast<double>(irregular) / inside : 0.0;
}

}  // namespace quadrig::gltf
