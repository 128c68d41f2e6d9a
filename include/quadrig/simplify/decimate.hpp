// Edge collapse by quadric errors that keeps the simplicial complex, its boundary loops and its orientation.
#pragma once

#include <bit>
#include <cstdint>
#include <tuple>

#include "quadrig/curves.hpp"

namespace quadrig::detail {

/// xᵀ A x − 2 bᵀ x + c: a sum of weighted squared distances to planes and points.
class Quadric {
 public:
  /// weight · (n·(x − p))², n of unit length.
  void add_plane(const Vector3& n, const Vector3& p, double weight) {
    const double d = n.dot(p);
    add(weight * Eigen::Matrix3d(n * n.transpose()), weight * d * n, weight * d * d);
  }
  /// weight · |x − p|².
  void add_point(const Vector3& p, double weight) {
    add(weight * Eigen::Matrix3d::Identity(), weight * p, weight * p.squaredNorm());
  }
  void add(const Quadric& other) { add(other.a_, other.b_, other.c_); }
  [[nodiscard]] double operator()(const Vector3& x) const { return x.dot(a_ * x) - 2 * b_.dot(x) + c_; }

 private:
  void add(const Eigen::Matrix3d& a, const Vector3& b, double c) {
    a_ += a;
    b_ += b;
    c_ += c;
  }
  Eigen::Matrix3d a_ = Eigen::Matrix3d::Zero();
  Vector3 b_ = Vector3::Zero();
  double c_ = 0;
};

/// 1 for an equilateral triangle, 0 for one without area.
[[nodiscard]] inline double triangle_quality(const Vector3& a, const Vector3& b, const Vector3& c) {
  const double sides = (b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm();
  return sides > 0 ? 2 * std::sqrt(3.0) * (b - a).cross(c - a).norm() / sides : 0;
}

/// A queue by `cost`, the least first, in bins of an eighth of an octave. Exactly: by operator< of T, the greatest
/// first, with the lowest bin kept as a heap. Else costs of one bin count as one, first come first served: neighbours
/// follow each other then, which is kind to caches, where a heap of very many is not.
template <class T>
class CostQueue {
 public:
  explicit CostQueue(bool exact) : exact_(exact) {}
  void push(const T& each) {
    const std::size_t b = bin(each.cost);
    bins_[b].push_back(each);
    if (exact_ && begun_[b]) std::push_heap(bins_[b].begin(), bins_[b].end());
    lowest_ = std::min(lowest_, b);
  }
  [[nodiscard]] bool empty() {
    while (lowest_ < bins_.size() && bins_[lowest_].size() == (exact_ ? 0 : begun_[lowest_])) {
      bins_[lowest_].clear();
      begun_[lowest_++] = 0;
    }
    return lowest_ == bins_.size();
  }
  /// \pre not empty()
  T pop() {
    std::vector<T>& least = bins_[lowest_];
    if (!exact_) return least[begun_[lowest_]++];
    if (!std::exchange(begun_[lowest_], std::size_t{1})) std::make_heap(least.begin(), least.end());
    std::pop_heap(least.begin(), least.end());
    const T each = least.back();
    least.pop_back();
    return each;
  }

 private:
  /// Sign, exponent and three bits more, in the order of the numbers.
  [[nodiscard]] static std::size_t bin(double cost) {
    const auto bits = std::bit_cast<std::uint64_t>(cost + 0.0);  // one zero
    return (bits >> 63 ? ~bits : bits | (std::uint64_t{1} << 63)) >> 49;
  }

  const bool exact_;
  std::vector<std::vector<T>> bins_{std::size_t{1} << 15};
  /// Of each bin whether it is a heap; not exactly: how many have been taken.
  std::vector<std::size_t> begun_ = std::vector<std::size_t>(std::size_t{1} << 15, 0);
  std::size_t lowest_ = std::size_t{1} << 15;
};

/// A triangle mesh that loses vertices; those that stay keep their numbers and places.
class Decimator {
 public:
  using Face = std::array<Index, 3>;

  /// `width` is how wide a strip of surface an edge of the boundary or of a crease stands for: about the edge length
  /// that is wanted. Curves of edges marked by `kept` stay curves, their corners where they are. Once cancelled it is
  /// not fit for use.
  Decimator(const TriangleMesh<double>& mesh, double uniformity, double width, const Context& context,
            const EdgeMarks& kept = {}) {
    const auto n = static_cast<std::size_t>(mesh.vertex_count());
    const auto m = static_cast<std::size_t>(mesh.face_count());
    const Vector3 center =
        (mesh.positions().colwise().maxCoeff() + mesh.positions().colwise().minCoeff()).transpose() / 2;
    positions_.resize(n);
    around_.resize(n);
    border_.assign(n, 0);
    quadrics_.resize(n);
    stamps_.assign(n, 0);
    marks_.assign(n, 0);
    faces_.resize(m);
    alive_ = mesh.face_count();
    unit_cost_ = (uniformity + 0.02) * (width * width) * (width * width) / 2;
    noise_ = 1e-4 * width;
    if (context.cancelled()) return;
    std::vector<std::size_t> valence(n, 0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h) ++valence[at(mesh.origin(h))];
    for (std::size_t v = 0; v < n; ++v) {
      if (v % 65536 == 0 && context.cancelled()) return;
      positions_[v] = mesh.position(static_cast<Index>(v)) - center;
      around_[v].reserve(valence[v]);
    }
    for (Index f = 0; f < mesh.face_count(); ++f) {
      if (f % 4096 == 0 && context.cancelled()) return;
      const Vector3 normal = mesh.normal(f);
      for (int i = 0; i < 3; ++i) {
        const Index v = mesh.faces()(f, i);
        faces_[at(f)][static_cast<std::size_t>(i)] = v;
        around_[at(v)].push_back(f);
        quadrics_[at(v)].add_plane(normal, positions_[at(v)], mesh.area(f) / 3);
        quadrics_[at(v)].add_point(positions_[at(v)], uniformity * mesh.area(f) / 3);
        const Index h = 3 * f + i;
        const Index w = mesh.target(h), across = mesh.twin(h);
        if (across == no_index) border_[at(v)] = border_[at(w)] = 1;
        // Upright planes hold the boundary as a face beyond it would, and sharp edges, be the face beyond ever so
        // narrow: the rim of a plate.
        if (across != no_index && mesh.normal(across / 3).dot(normal) > 0.5 && (kept.empty() || !kept[at(h)])) continue;
        const Vector3 along = mesh.edge_vector(h), upright = along.cross(normal);
        const double length = upright.norm(), weight = across == no_index ? 3 : 1;
        if (!(length > 0)) continue;
        for (const Index end : {v, w})
          quadrics_[at(end)].add_plane(upright / length, positions_[at(v)], weight * along.norm() * width);
      }
    }
    if (!kept.empty()) keep(mesh, kept);
  }

  [[nodiscard]] Index face_count() const { return alive_; }
  /// The faces that are left, in the order of the input.
  [[nodiscard]] std::vector<Face> faces() const {
    std::vector<Face> result;
    for (const Face& f : faces_)
      if (f[0] != no_index) result.push_back(f);
    return result;
  }

  /// Whether an edge of what is left is one of a curve that was to be kept.
  [[nodiscard]] bool kept(Index v, Index w) const {
    return !curve_.empty() && std::find(curve_[at(v)].begin(), curve_[at(v)].end(), w) != curve_[at(v)].end();
  }

  /// Collapses edges, cheapest first, until at most `wanted` faces are left or none may be collapsed any more. Shapes
  /// are held to a high standard as long as that costs little, to less where the surface would suffer for it.
  [[nodiscard]] Status reduce(Index wanted, Context& context) {
    if (context.cancelled()) return cancelled_error("simplify");
    constexpr Rule rules[] = {{0.5, 0.6}, {0.3, 0.4}, {0.1, 0.3}, {0.02, 0.2}, {1e-4, 0.1}};
    constexpr int few_times = 4;  // the number wanted: above it the order is not exact
    constexpr double costs[] = {2, 16, 128, std::numeric_limits<double>::infinity()};
    for (std::size_t c = 0; c < std::size(costs); ++c)
      for (std::size_t r = 0; r < std::min(c + 3, std::size(rules)); ++r)
        for (Index before = alive_; alive_ > wanted; before = alive_) {
          // Flips on the way keep the triangles fit for further collapses.
          const bool many = alive_ > few_times * std::int64_t{wanted};
          const Index stop = std::max(many ? few_times * wanted : wanted, alive_ / 3);
          if (!sweep(rules[r], stop, costs[c] * unit_cost_, !many, context)) return cancelled_error("simplify");
          if (alive_ <= 8 * std::int64_t{wanted}) flip(context);
          if (context.cancelled()) return cancelled_error("simplify");
          if (alive_ > stop && before - alive_ <= before / 50) break;
        }
    return {};
  }

 private:
  /// What a collapse must leave: triangles of at least this quality, unless they were worse before, and turned from
  /// where they were by no more than the angle of this cosine.
  struct Rule {
    double quality, cosine;
  };
  struct Candidate {
    double cost;
    Index from, to;
    std::uint32_t from_stamp, to_stamp;
    bool operator<(const Candidate& other) const {  // the cheapest is the greatest
      return std::tie(cost, from, to) > std::tie(other.cost, other.from, other.to);
    }
  };

  void keep(const TriangleMesh<double>& mesh, const EdgeMarks& kept) {
    const EdgeCurves curves(mesh, kept, EdgeCurves::eighth);
    curve_.resize(around_.size());
    for (Index h = 0; h < mesh.halfedge_count(); ++h) {
      if (!kept[at(h)] || !mesh.is_representative(h)) continue;
      curve_[at(mesh.origin(h))].push_back(mesh.target(h));
      curve_[at(mesh.target(h))].push_back(mesh.origin(h));
    }
    for (Index v = 0; v < mesh.vertex_count(); ++v)
      corner_.push_back(curves.corner(v) || (border_[at(v)] && !curve_[at(v)].empty()));
  }
  /// A vertex of a curve may only go along it, and the curve remains one: no loop of two edges.
  [[nodiscard]] bool keeps_curves(Index from, Index to) const {
    if (curve_.empty() || curve_[at(from)].empty()) return true;
    if (corner_[at(from)] || !kept(from, to)) return false;
    const Index other = curve_[at(from)][0] == to ? curve_[at(from)][1] : curve_[at(from)][0];
    return other != to && !kept(other, to);
  }
  void move_curve(Index from, Index to) {
    if (curve_.empty() || curve_[at(from)].empty()) return;
    const Index other = curve_[at(from)][0] == to ? curve_[at(from)][1] : curve_[at(from)][0];
    std::replace(curve_[at(to)].begin(), curve_[at(to)].end(), from, other);
    std::replace(curve_[at(other)].begin(), curve_[at(other)].end(), from, to);
    curve_[at(from)].clear();
  }

  [[nodiscard]] const Vector3& point(Index v) const { return positions_[at(v)]; }
  [[nodiscard]] static bool has(const Face& f, Index v) { return f[0] == v || f[1] == v || f[2] == v; }
  [[nodiscard]] Vector3 cross(const Face& f) const {
    return (point(f[1]) - point(f[0])).cross(point(f[2]) - point(f[0]));
  }
  [[nodiscard]] double quality(const Face& f) const { return triangle_quality(point(f[0]), point(f[1]), point(f[2])); }
  void mark_fresh() {
    if (++mark_ != 0) return;
    std::fill(marks_.begin(), marks_.end(), 0u);
    mark_ = 1;
  }

  [[nodiscard]] Candidate candidate(Index from, Index to) const {
    // What the sum of all squared distances grows by.
    const Quadric& q = quadrics_[at(from)];
    return {q(point(to)) - q(point(from)), from, to, stamps_[at(from)], stamps_[at(to)]};
  }

  /// Returns false where the caller asked to stop.
  bool sweep(const Rule& rule, Index stop, double highest_cost, bool exact, Context& context) {
    CostQueue<Candidate> queue(exact);
    const auto offer = [&](Index from, Index to) {
      if (const Candidate c = candidate(from, to); !(c.cost > highest_cost)) queue.push(c);
    };
    std::size_t steps = 0;
    for (const Face& f : faces_) {
      if (++steps % 4096 == 0 && context.cancelled()) return false;
      if (f[0] == no_index) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        // Each inner edge is met from both sides, once in each direction.
        offer(f[i], f[(i + 1) % 3]);
        if (border_[at(f[i])] && border_[at(f[(i + 1) % 3])]) offer(f[(i + 1) % 3], f[i]);
      }
    }
    while (alive_ > stop && !queue.empty()) {
      if (++steps % 4096 == 0 && context.cancelled()) return false;
      const Candidate c = queue.pop();
      if (c.from_stamp != stamps_[at(c.from)] || c.to_stamp != stamps_[at(c.to)]) continue;
      if (!keeps_curves(c.from, c.to) || !keeps_topology(c.from, c.to) || !keeps_shape(c.from, c.to, rule)) continue;
      collapse(c.from, c.to);
      ++stamps_[at(c.from)];
      ++stamps_[at(c.to)];
      mark_fresh();
      for (const Index f : around_[at(c.to)])
        for (const Index w : faces_[at(f)])
          if (w != c.to && std::exchange(marks_[at(w)], mark_) != mark_) {
            offer(c.to, w);
            offer(w, c.to);
          }
    }
    return true;
  }

  /// The link condition (the boundary seen as joined to a vertex at infinity), so that what is left is a simplicial
  /// complex of the same topology: at least a tetrahedron, a triangle, or loops of three edges.
  bool keeps_topology(Index from, Index to) {
    Index shared[2], opposite[2];
    std::size_t count = 0;
    for (const Index f : around_[at(from)]) {
      const Face& face = faces_[at(f)];
      if (!has(face, to)) continue;
      if (count == 2) return false;
      for (const Index w : face)
        if (w != from && w != to) opposite[count] = w;
      shared[count++] = f;
    }
    if (count == 0 || (count == 2 && shared[0] == shared[1])) return false;
    if (border_[at(from)] && count == 2) return false;  // would pull the boundary in, or pinch it
    if (count == 1 && around_[at(from)].size() == 1 && around_[at(to)].size() == 1) return false;  // the last triangle
    mark_fresh();
    for (const Index f : around_[at(to)])
      for (const Index w : faces_[at(f)]) marks_[at(w)] = mark_;
    for (const Index f : around_[at(from)])
      for (const Index w : faces_[at(f)])
        if (w != from && w != to && marks_[at(w)] == mark_ && w != opposite[0] && (count == 1 || w != opposite[1]))
          return false;
    if (count == 2) {
      const auto spans = [&](Index v) {
        return std::any_of(around_[at(v)].begin(), around_[at(v)].end(),
                           [&](Index f) { return has(faces_[at(f)], opposite[0]) && has(faces_[at(f)], opposite[1]); });
      };
      if (spans(from) && spans(to)) return false;  // the last tetrahedron
    }
    return true;
  }

  bool keeps_shape(Index from, Index to, const Rule& rule) const {
    if ((point(to) - point(from)).squaredNorm() < noise_ * noise_) return keeps_large_faces(from, to);
    double worst = 1;
    Vector3 ring = Vector3::Zero();
    for (const Index f : around_[at(from)]) {
      worst = std::min(worst, quality(faces_[at(f)]));
      ring += cross(faces_[at(f)]);
    }
    const double floor = std::min(rule.quality, worst);
    for (const Index f : around_[at(from)]) {
      Face face = faces_[at(f)];
      if (has(face, to)) continue;
      const double old_quality = quality(face);
      const Vector3 old = cross(face);
      std::replace(face.begin(), face.end(), from, to);
      if (quality(face) < floor) return false;
      const Vector3 now = cross(face);
      const auto turned = [&](const Vector3& from_here) {
        return !(now.dot(from_here) > rule.cosine * now.norm() * from_here.norm());
      };
      // A needle's own normal may be noise: that of its ring is used.
      if (turned(old) && (old_quality > 0.05 || turned(ring))) return false;
    }
    return true;
  }

  /// For collapses that move almost nothing: faces narrower than noise have no shape to keep.
  bool keeps_large_faces(Index from, Index to) const {
    for (const Index f : around_[at(from)]) {
      Face face = faces_[at(f)];
      if (has(face, to)) continue;
      const Vector3 old = cross(face);
      double longest = 0;
      for (std::size_t i = 0; i < 3; ++i)
        longest = std::max(longest, (point(face[(i + 1) % 3]) - point(face[i])).squaredNorm());
      if (old.squaredNorm() < 16 * noise_ * noise_ * longest) continue;
      std::replace(face.begin(), face.end(), from, to);
      if (!(cross(face).dot(old) > 0)) return false;
    }
    return true;
  }

  void collapse(Index from, Index to) {
    move_curve(from, to);
    for (const Index f : around_[at(from)]) {
      Face& face = faces_[at(f)];
      if (has(face, to)) {
        for (const Index w : face)
          if (w != from) std::erase(around_[at(w)], f);
        face[0] = no_index;
        --alive_;
      } else {
        std::replace(face.begin(), face.end(), from, to);
        around_[at(to)].push_back(f);
      }
    }
    around_[at(from)].clear();
    around_[at(from)].shrink_to_fit();
    quadrics_[at(to)].add(quadrics_[at(from)]);
  }

  /// Turns inner edges where that raises the lesser quality of their two triangles and hardly bends the surface.
  void flip(const Context& context) {
    for (int round = 0; round < 5; ++round) {
      Index flipped = 0;
      for (Index f = 0; f < static_cast<Index>(faces_.size()); ++f) {
        if (f % 4096 == 0 && context.cancelled()) return;
        for (std::size_t i = 0; faces_[at(f)][0] != no_index && i < 3; ++i) flipped += flip(f, i);
      }
      if (flipped == 0) break;
    }
  }

  bool flip(Index f, std::size_t side) {
    const Index a = faces_[at(f)][side], b = faces_[at(f)][(side + 1) % 3], c = faces_[at(f)][(side + 2) % 3];
    Index g = no_index;
    for (const Index other : around_[at(a)])
      if (other != f && has(faces_[at(other)], b)) g = other;
    if (g == no_index || kept(a, b)) return false;
    Index d = no_index;
    for (const Index w : faces_[at(g)])
      if (w != a && w != b) d = w;
    const Face one{a, d, c}, two{d, b, c};
    const double before = std::min(quality(faces_[at(f)]), quality(faces_[at(g)]));
    const double after = std::min(quality(one), quality(two));
    if (!(after > before + 0.02) && !(after > 1.5 * before)) return false;
    const Vector3 sum = cross(faces_[at(f)]) + cross(faces_[at(g)]), n1 = cross(one), n2 = cross(two);
    constexpr double cosine = 0.97;
    if (!(n1.dot(sum) > cosine * n1.norm() * sum.norm()) || !(n2.dot(sum) > cosine * n2.norm() * sum.norm()))
      return false;
    for (const Index v : {f, g}) {
      const Vector3 old = cross(faces_[at(v)]);
      if (quality(faces_[at(v)]) > 0.05 && !(old.dot(sum) > cosine * old.norm() * sum.norm())) return false;
    }
    for (const Index other : around_[at(c)])
      if (has(faces_[at(other)], d)) return false;  // the edge is already there
    faces_[at(f)] = one;
    faces_[at(g)] = two;
    std::erase(around_[at(b)], f);
    std::erase(around_[at(a)], g);
    around_[at(d)].push_back(f);
    around_[at(c)].push_back(g);
    return true;
  }

  std::vector<Vector3> positions_;
  std::vector<Face> faces_;
  std::vector<std::vector<Index>> around_;  // faces of each vertex
  std::vector<char> border_, corner_;       // corner_: of curves that are kept, where there are any
  std::vector<std::vector<Index>> curve_;   // the neighbours of each vertex along these
  std::vector<Quadric> quadrics_;
  std::vector<std::uint32_t> stamps_, marks_;
  std::uint32_t mark_ = 0;
  Index alive_ = 0;
  double noise_ = 0;      // edges shorter than this are no part of the shape
  double unit_cost_ = 0;  // of a triangle of the wanted size that is a seventh of its width off the surface
};

}  // namespace quadrig::detail
