// Samples of the lines of a surface that edges of quads run along, and where they lie on drawn edges.
#pragma once

#include "quadrig/curves.hpp"
#include "quadrig/fit/basis.hpp"

namespace quadrig::detail {

/// The lines that quads are fitted to: the border of the surface, and edges that the quads keep.
class SurfaceLines {
 public:
  /// \param kept marks of edges beside the border, or empty
  SurfaceLines(const TriangleMesh<double>& surface, const EdgeMarks& kept)
      : surface_(surface), curves_(surface, joined_marks(border_marks(surface), kept)) {}

  [[nodiscard]] const EdgeCurves& curves() const { return curves_; }
  [[nodiscard]] bool lies_on(const SurfacePoint& point) const { return curves_.under(point, near) != no_index; }
  /// Whether the point is where lines meet, end or turn sharply: a place that a quad's corner keeps.
  [[nodiscard]] bool at_corner(const SurfacePoint& point) const {
    for (int i = 0; i < 3; ++i)
      if (point.barycentric[i] >= 1 - near) return turns(surface_.faces()(point.face, i));
    return false;
  }
  /// How far it is along a line between the ends of an edge of quads; nothing where it does not follow one.
  [[nodiscard]] std::optional<double> length_of(const SurfacePoint& a, const SurfacePoint& b) const {
    constexpr double longest = 1.5;  // times the way through space
    const std::optional<double> length = curves_.distance(a, b, near);
    if (!length || !(*length < longest * (position(surface_, a) - position(surface_, b)).norm())) return std::nullopt;
    return length;
  }

 private:
  static constexpr double near = 1e-6;  // a barycentric coordinate

  [[nodiscard]] bool turns(Index v) const {
    constexpr double sharp = 0.766;  // cos 40°
    std::array<Vector3, 2> way;
    std::size_t count = 0;
    const auto add = [&](const Vector3& edge) {
      if (count < 2) way[count] = edge.normalized();
      ++count;
    };
    for (const Index h : surface_.around(v)) {
      if (curves_.marked(h)) add(surface_.edge_vector(h));
      if (const Index in = surface_.prev(h); surface_.twin(in) == no_index) add(-surface_.edge_vector(in));
    }
    return count > 0 && (count != 2 || -way[0].dot(way[1]) < sharp);
  }

  const TriangleMesh<double>& surface_;
  EdgeCurves curves_;
};

/// Edges of quads may stray along their line, not off it: of each sample two directions across.
class LineSamples {
 public:
  struct Sample {
    Vector3 position;
    std::array<Vector3, 2> across;  ///< unit, and to the line
    double length = 0;              ///< of the line that the sample stands for
    Index side = no_index;          ///< 4 q + i of a drawn quad q
    double along = 0;               ///< of the side, in [0, 1]
  };

  /// \param cage with a source a vertex, whose edges the basis draws \param spacing of the samples, a length
  LineSamples(const TriangleMesh<double>& surface, const SurfaceLines& lines, const QuadMesh& cage,
              const FitBasis& basis, double spacing)
      : basis_(basis) {
    if (lines.curves().empty()) return;
    const QuadCorners corners(cage);
    touching_.resize(static_cast<std::size_t>(basis.drawn().positions().rows()));
    for (Index q = 0; q < cage.quad_count(); ++q)
      for (int i = 0; i < 4; ++i) {
        const Index v = cage.quads(q, i), w = cage.quads(q, (i + 1) % 4);
        if (!lines.lies_on(cage.source[at(v)]) || !lines.lies_on(cage.source[at(w)])) continue;
        if (second_side(corners, cage, q, v, w)) continue;
        if (const auto length = lines.length_of(cage.source[at(v)], cage.source[at(w)]))
          add_edge(surface, lines.curves(), cage, 4 * q + i, *length, spacing);
      }
    for (Sample& sample : samples_) walk(sample);
    sort_by_quad();
  }

  [[nodiscard]] const Sample& operator[](std::size_t s) const { return samples_[s]; }
  /// Samples whose place is on a quad of the cage.
  [[nodiscard]] std::span<const std::size_t> on(Index quad) const {
    if (samples_.empty()) return {};
    return std::span(by_quad_).subspan(first_[at(quad)], first_[at(quad) + 1] - first_[at(quad)]);
  }
  /// New places after the vertices have moved.
  void place() {
    for (Sample& sample : samples_) walk(sample);
    if (!samples_.empty()) sort_by_quad();
  }

 private:
  [[nodiscard]] Index from(Index side) const { return basis_.drawn().quads()(side / 4, side % 4); }
  [[nodiscard]] Index to(Index side) const { return basis_.drawn().quads()(side / 4, (side + 1) % 4); }

  /// Whether a quad of lower number has the edge too.
  [[nodiscard]] static bool second_side(const QuadCorners& corners, const QuadMesh& cage, Index q, Index v, Index w) {
    for (const Index c : corners.at(w))
      if (c / 4 < q && cage.quads(c / 4, (c + 1) % 4) == v) return true;
    return false;
  }

  /// Samples of the line along one edge of the cage, and the drawn edges that it is drawn as.
  void add_edge(const TriangleMesh<double>& surface, const EdgeCurves& curves, const QuadMesh& cage, Index side,
                double length, double spacing) {
    const SurfacePoint &a = cage.source[at(cage.quads(side / 4, side % 4))],
                       &b = cage.source[at(cage.quads(side / 4, (side + 1) % 4))];
    const std::vector<Index> drawn = drawn_sides(side);
    for (const Index each : drawn)
      for (const Index v : {from(each), to(each)})
        if (std::vector<Index>& own = touching_[at(v)]; std::ranges::find(own, each) == own.end()) own.push_back(each);
    const auto count = static_cast<int>(std::clamp(std::ceil(length / spacing), 1.0, 1e4));
    for (int k = 0; k < count; ++k) {
      const std::optional<SurfacePoint> point = curves.between(a, b, (k + 0.5) / count);
      if (!point) continue;
      const Vector3 tangent = surface.edge_vector(curves.under(*point)).normalized();
      Eigen::Index least = 0;
      tangent.cwiseAbs().minCoeff(&least);
      const Vector3 one = tangent.cross(Vector3::Unit(least)).normalized();
      Sample sample{position(surface, *point), {one, tangent.cross(one)}, length / count, no_index, 0};
      double best = std::numeric_limits<double>::infinity();
      for (const Index each : drawn)
        if (const double distance = nearest(each, sample.position).first; distance < best)
          best = distance, sample.side = each;
      samples_.push_back(sample);
    }
  }
  [[nodiscard]] std::vector<Index> drawn_sides(Index side) const {
    if (basis_.is_flat()) return {side};
    // A subdivided quad has the parts of its sides on the border that they came from.
    std::vector<Index> sides;
    for (const Index part : basis_.drawn_of(side / 4))
      for (Index each = 4 * part; each < 4 * part + 4; ++each)
        if (basis_.drawn().twin(each) == no_index) sides.push_back(each);
    return sides;
  }
  /// Squared distance to a side, and where on it.
  [[nodiscard]] std::pair<double, double> nearest(Index side, const Vector3& p) const {
    const Vector3 a = basis_.drawn().position(from(side)), d = basis_.drawn().position(to(side)) - a;
    const double length = d.squaredNorm(), t = length > 0 ? std::clamp((p - a).dot(d) / length, 0.0, 1.0) : 0;
    return {(a + t * d - p).squaredNorm(), t};
  }
  void walk(Sample& sample) const {
    if (sample.side == no_index) return;
    auto [best, along] = nearest(sample.side, sample.position);
    for (Index before = no_index; sample.side != before;) {
      before = sample.side;
      for (const Index end : {from(before), to(before)}) {
        const std::vector<Index>& others = touching_[at(end)];
        if (others.size() != 2) continue;  // lines meet or end
        const Index side = others[0] == before ? others[1] : others[0];
        const auto [distance, there] = nearest(side, sample.position);
        if (distance < best) sample.side = side, best = distance, along = there;
      }
    }
    sample.along = along;
  }

  void sort_by_quad() {
    first_.assign(at(basis_.quad_count()) + 1, 0);
    const auto quad = [&](const Sample& sample) { return basis_.cage_of(sample.side / 4); };
    for (const Sample& sample : samples_)
      if (sample.side != no_index) ++first_[at(quad(sample)) + 1];
    for (std::size_t q = 1; q < first_.size(); ++q) first_[q] += first_[q - 1];
    by_quad_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t s = 0; s < samples_.size(); ++s)
      if (samples_[s].side != no_index) by_quad_[next[at(quad(samples_[s]))]++] = s;
  }

  const FitBasis& basis_;
  std::vector<Sample> samples_;
  std::vector<std::vector<Index>> touching_;  // of each drawn vertex the sides on lines that end there
  std::vector<std::size_t> first_, by_quad_;
};

}  // namespace quadrig::detail
