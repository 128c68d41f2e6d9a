#pragma once

#include <algorithm>
#include <map>
#include <queue>
#include <set>

#include "quadrig/prepare/gaps.hpp"

namespace quadrig {
namespace gaps_detail {

using Corners = std::array<Index, 3>;
[[nodiscard]] inline std::size_t at(Index i) { return static_cast<std::size_t>(i); }

/// π minus the angles of the surface, of each border vertex; 0 inside.
[[nodiscard]] inline std::vector<double> border_turns(const TriangleMesh<double>& mesh) {
  std::vector<double> turns(at(mesh.vertex_count()), 0.0);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (!mesh.on_boundary(v)) continue;
    turns[at(v)] = std::numbers::pi;
    for (const Index h : mesh.around(v)) turns[at(v)] -= mesh.corner_angle(h);
  }
  return turns;
}

/// Edges of a mesh and those that triangles add to it.
class Edges {
 public:
  explicit Edges(const TriangleMesh<double>& mesh) : mesh_(mesh) {}
  [[nodiscard]] bool has(Index v, Index w) const {
    if (added_.contains(std::minmax(v, w))) return true;
    for (const Index h : mesh_.around(v))
      if (mesh_.target(h) == w || mesh_.origin(mesh_.prev(h)) == w) return true;
    return false;
  }
  void add(Index v, Index w) { added_.insert(std::minmax(v, w)); }

 private:
  const TriangleMesh<double>& mesh_;
  std::set<std::pair<Index, Index>> added_;
};

/// The triangles of one hole: ears cut off its rim, that with the shortest chord first, in the plane of Newell's
/// normal.
class HoleFill {
 public:
  /// \param rim counter-clockwise as the triangles will be
  HoleFill(const TriangleMesh<double>& mesh, std::vector<Index> rim, const Edges& edges)
      : mesh_(mesh), rim_(std::move(rim)), edges_(edges) {
    for (std::size_t k = 0; k < rim_.size(); ++k) normal_ += point(k).cross(point((k + 1) % rim_.size()));
  }

  /// Empty where no triangles close it.
  [[nodiscard]] std::vector<Corners> run() {
    std::vector<Corners> made;
    while (rim_.size() > 3) {
      std::size_t ear = best(true);
      if (ear == none) ear = best(false);
      if (ear == none) return {};
      const std::size_t before = (ear + rim_.size() - 1) % rim_.size(), after = (ear + 1) % rim_.size();
      made.push_back({rim_[before], rim_[ear], rim_[after]});
      chords_.insert(std::minmax(rim_[before], rim_[after]));
      rim_.erase(rim_.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    if (!has_area(0)) return {};
    made.push_back({rim_[0], rim_[1], rim_[2]});
    return made;
  }
  [[nodiscard]] const std::set<std::pair<Index, Index>>& chords() const { return chords_; }

 private:
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

  [[nodiscard]] Vector3 point(std::size_t k) const { return mesh_.position(rim_[k]); }
  /// Twice the area of the triangle of a corner of the rim and its neighbours, with its direction.
  [[nodiscard]] Vector3 area_at(std::size_t k) const {
    const Vector3 a = point((k + rim_.size() - 1) % rim_.size()), b = point(k), c = point((k + 1) % rim_.size());
    return (b - a).cross(c - b);
  }
  [[nodiscard]] bool has_area(std::size_t k) const {
    constexpr double flat = 1e-6;
    const Vector3 a = point((k + rim_.size() - 1) % rim_.size()), b = point(k), c = point((k + 1) % rim_.size());
    const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    return area_at(k).norm() > flat * longest;
  }
  [[nodiscard]] bool is_ear(std::size_t k) const {
    if (!(area_at(k).dot(normal_) > 0)) return false;
    const std::size_t n = rim_.size(), before = (k + n - 1) % n, after = (k + 1) % n;
    const Vector3 a = point(before), b = point(k), c = point(after);
    const auto left = [&](const Vector3& from, const Vector3& to, const Vector3& p) {
      return (to - from).cross(p - from).dot(normal_) > 0;
    };
    for (std::size_t i = 0; i < n; ++i) {
      if (i == before || i == k || i == after) continue;
      const Vector3 p = point(i);
      if (left(a, b, p) && left(b, c, p) && left(c, a, p)) return false;
    }
    return true;
  }
  [[nodiscard]] std::size_t best(bool convex) const {
    std::size_t best = none;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < rim_.size(); ++k) {
      const std::size_t before = (k + rim_.size() - 1) % rim_.size(), after = (k + 1) % rim_.size();
      const double chord = (point(after) - point(before)).squaredNorm();
      if (!(chord < shortest) || !has_area(k) || (convex && !is_ear(k)) || edges_.has(rim_[before], rim_[after]) ||
          chords_.contains(std::minmax(rim_[before], rim_[after])))
        continue;
      shortest = chord;
      best = k;
    }
    return best;
  }

  const TriangleMesh<double>& mesh_;
  std::vector<Index> rim_;
  const Edges& edges_;
  std::set<std::pair<Index, Index>> chords_;
  Vector3 normal_ = Vector3::Zero();
};

/// A rim that passes a position twice as several that do not: `same` joins the vertices there. What is left of the rim
/// comes last; rims of two are slits, which close by that alone.
[[nodiscard]] inline std::vector<std::vector<Index>> simple_rims(const TriangleMesh<double>& mesh,
                                                                 const std::vector<Index>& rim,
                                                                 std::map<Index, Index>& same) {
  std::map<std::array<double, 3>, std::size_t> place;  // in the rim that is being walked
  std::vector<std::vector<Index>> simple(1);
  std::vector<Index> open;
  const auto key = [&](Index v) {
    const Vector3 p = mesh.position(v);
    return std::array{p[0], p[1], p[2]};
  };
  for (const Index v : rim) {
    const auto [found, is_new] = place.try_emplace(key(v), open.size());
    if (is_new) {
      open.push_back(v);
      continue;
    }
    same[v] = open[found->second];
    const auto first = open.begin() + static_cast<std::ptrdiff_t>(found->second);
    std::vector<Index> inner(first, open.end());
    for (std::size_t k = 1; k < inner.size(); ++k) place.erase(key(inner[k]));
    open.erase(first + 1, open.end());
    if (inner.size() > 2) simple.insert(simple.end() - 1, std::move(inner));
  }
  simple.back() = std::move(open);
  if (simple.back().size() < 3) simple.pop_back();
  return simple;
}

/// The triangles that close small holes, into `faces`.
inline void close_holes(const TriangleMesh<double>& mesh, const GapOptions& options, std::vector<Corners>& faces,
                        std::map<Index, Index>& same, Bridged& result, const Context& context) {
  constexpr std::size_t most_corners = 2000;  // the work is their square
  const std::vector<double> turns = border_turns(mesh);
  std::vector<char> seen(at(mesh.vertex_count()), 0);
  Edges edges(mesh);
  for (Index v = 0; v < mesh.vertex_count() && !context.cancelled(); ++v) {
    if (seen[at(v)] || !mesh.on_boundary(v)) continue;
    std::vector<Index> rim;
    double length = 0, turn = 0;
    Vector3 centre = Vector3::Zero();
    for (Index w = v; !seen[at(w)]; w = mesh.target(mesh.outgoing(w))) {
      seen[at(w)] = 1;
      rim.push_back(w);
      const double edge = mesh.edge_vector(mesh.outgoing(w)).norm();
      centre += edge * (mesh.position(w) + mesh.edge_vector(mesh.outgoing(w)) / 2);
      length += edge;
      turn += turns[at(w)];
    }
    // A flat sheet's outline turns by 2π, the end of a tube not at all, a hole by −2π.
    const bool hole = turn<-std::numbers::pi, outline = turn> std::numbers::pi;
    if (outline || !(length <= (hole ? std::max(options.hole, options.end) : options.end))) continue;
    if (rim.size() > most_corners) {
      ++result.left_open;
      continue;
    }
    std::reverse(rim.begin(), rim.end());
    std::map<Index, Index> joined;
    std::vector<Corners> made;
    bool closed = true;
    std::set<std::pair<Index, Index>> chords;
    for (std::vector<Index>& simple : simple_rims(mesh, rim, joined)) {
      HoleFill fill(mesh, std::move(simple), edges);
      const std::vector<Corners> triangles = fill.run();
      closed = closed && !triangles.empty();
      made.insert(made.end(), triangles.begin(), triangles.end());
      chords.insert(fill.chords().begin(), fill.chords().end());
    }
    if (!closed) {
      ++result.left_open;
      continue;
    }
    faces.insert(faces.end(), made.begin(), made.end());
    for (const auto& [a, b] : chords) edges.add(a, b);
    same.merge(joined);
    result.holes.push_back({centre / length, length});
  }
}

/// The border of a mesh while notches of it are filled.
class BorderFill {
 public:
  BorderFill(const TriangleMesh<double>& mesh, double notch)
      : mesh_(mesh),
        notch_(notch),
        turn_(border_turns(mesh)),
        next_(at(mesh.vertex_count()), no_index),
        before_(next_),
        length_(next_.size(), 0.0),
        normal_(mesh.vertex_count(), 3),
        edges_(mesh) {
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      if (!mesh.on_boundary(v)) continue;
      const Index h = mesh.outgoing(v), w = mesh.target(h);
      next_[at(v)] = w;
      before_[at(w)] = v;
      length_[at(v)] = mesh.edge_vector(h).norm();
      normal_.row(v) = mesh.normals().row(h / 3);
    }
  }

  /// \return how many triangles were added to `faces`
  Index run(std::vector<Corners>& faces, double& area, const Context& context) {
    std::priority_queue<Notch, std::vector<Notch>, std::greater<>> open;  // the smallest first
    for (Index v = 0; v < mesh_.vertex_count(); ++v)
      if (const double size = notch_area(v); size > 0) open.emplace(size, v);
    Index filled = 0;
    while (!open.empty() && !context.cancelled()) {
      const auto [size, v] = open.top();
      open.pop();
      const double now = notch_area(v);
      if (!(now > 0)) continue;
      if (now != size) {
        open.emplace(now, v);
        continue;
      }
      const Index u = before_[at(v)], w = next_[at(v)];
      fill(u, v, w);
      faces.push_back({w, v, u});
      area += now;
      ++filled;
      for (const Index end : {u, w})
        if (const double again = notch_area(end); again > 0) open.emplace(again, end);
    }
    return filled;
  }

 private:
  using Notch = std::pair<double, Index>;

  [[nodiscard]] Vector3 to(Index v, Index w) const { return mesh_.position(w) - mesh_.position(v); }
  [[nodiscard]] static double angle(const Vector3& a, const Vector3& b) {
    return elementary::atan2(a.cross(b).norm(), a.dot(b));
  }

  /// How much more the border turns to and fro about a vertex than it turns on.
  [[nodiscard]] double ragged(Index v) const {
    constexpr int most_steps = 2000;
    double both = std::abs(turn_[at(v)]), sum = turn_[at(v)], gone = 0;
    const auto add = [&](Index w) {
      both += std::abs(turn_[at(w)]);
      sum += turn_[at(w)];
    };
    const double reach = 2 * notch_;
    Index last = v, w = v;
    for (int k = 0; k < most_steps; ++k) {
      gone += length_[at(w)];
      w = next_[at(w)];
      if (gone > reach || w == v) break;
      add(w);
      last = w;
    }
    gone = 0;
    w = v;
    for (int k = 0; k < most_steps; ++k) {
      w = before_[at(w)];
      gone += length_[at(w)];
      if (gone > reach || w == v || w == last) break;
      add(w);
    }
    return both - std::abs(sum);
  }

  /// The triangle that fills the notch of a vertex; 0 where there is none.
  [[nodiscard]] double notch_area(Index v) const {
    constexpr double least_turn = 20 * std::numbers::pi / 180, ragged_radians = 2 * std::numbers::pi / 3;
    constexpr double along = 0.4, flat = 1e-3;  // cosine with the faces beside it; height over width
    if (next_[at(v)] == no_index || turn_[at(v)] > -least_turn) return 0;
    const Index u = before_[at(v)], w = next_[at(v)];
    if (u == w || next_[at(w)] == u) return 0;
    const Vector3 chord = to(u, w), twice = to(w, v).cross(to(w, u));
    const double width = chord.norm(), height = twice.norm() / width;
    if (!(width <= 2 * notch_) || !(height <= notch_) || !(height > flat * width)) return 0;
    const Vector3 beside = (normal_.row(u) + normal_.row(v)).transpose();
    if (!(twice.dot(beside) > along * twice.norm() * beside.norm())) return 0;
    if (edges_.has(u, w) || ragged(v) < ragged_radians) return 0;
    return twice.norm() / 2;
  }

  void fill(Index u, Index v, Index w) {
    edges_.add(u, w);
    turn_[at(u)] -= angle(to(u, w), to(u, v));
    turn_[at(w)] -= angle(to(w, v), to(w, u));
    next_[at(u)] = w;
    before_[at(w)] = u;
    next_[at(v)] = before_[at(v)] = no_index;
    length_[at(u)] = to(u, w).norm();
    normal_.row(u) = to(w, v).cross(to(w, u)).normalized().transpose();
  }

  const TriangleMesh<double>& mesh_;
  const double notch_;
  std::vector<double> turn_;
  std::vector<Index> next_, before_;  // along the border; no_index inside
  std::vector<double> length_;        // to the next
  Points<double> normal_;             // of the face beside the edge to the next
  Edges edges_;
};

/// The mesh with more faces, and with some vertices taken for others. \pre they are manifold
[[nodiscard]] inline std::optional<TriangleMesh<double>> with_faces(const TriangleMesh<double>& mesh,
                                                                    const std::vector<Corners>& faces,
                                                                    const std::map<Index, Index>& same) {
  Triangles all(mesh.face_count() + static_cast<Index>(faces.size()), 3);
  all.topRows(mesh.face_count()) = mesh.faces();
  Index f = mesh.face_count();
  for (const Corners& face : faces) all.row(f++) << face[0], face[1], face[2];
  for (f = 0; f < static_cast<Index>(all.rows()) && !same.empty(); ++f)
    for (int i = 0; i < 3; ++i)
      for (auto found = same.find(all(f, i)); found != same.end(); found = same.find(all(f, i)))
        all(f, i) = found->second;
  Expected<TriangleMesh<double>> made = TriangleMesh<double>::create(mesh.positions(), std::move(all));
  if (!made) return std::nullopt;
  return std::move(*made);
}

}  // namespace gaps_detail

QUADRIG_INLINE std::optional<Bridged> bridge_gaps(const TriangleMesh<double>& mesh, const GapOptions& options,
                                                  const Context& context) {
  using namespace gaps_detail;
  if (mesh.closed()) return std::nullopt;
  Bridged result;
  result.faces_before = mesh.face_count();
  std::vector<Corners> faces;
  std::map<Index, Index> same;
  if (options.hole > 0 || options.end > 0) close_holes(mesh, options, faces, same, result, context);
  const TriangleMesh<double>* whole = &mesh;
  if (!result.holes.empty()) {
    std::optional<TriangleMesh<double>> closed = with_faces(mesh, faces, same);
    if (closed)
      result.mesh = std::move(*closed), whole = &result.mesh;
    else
      result.left_open += static_cast<Index>(result.holes.size()), result.holes.clear();
  }
  if (options.notch > 0) {
    faces.clear();
    result.notches = BorderFill(*whole, options.notch).run(faces, result.notch_area, context);
    if (result.notches > 0) {
      std::optional<TriangleMesh<double>> calm = with_faces(*whole, faces, {});
      if (calm)
        result.mesh = std::move(*calm);
      else
        result.notches = 0, result.notch_area = 0;
    }
  }
  if (context.cancelled() || (result.holes.empty() && result.notches == 0)) return std::nullopt;
  return result;
}

}  // namespace quadrig
