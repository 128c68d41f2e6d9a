// Samples of a surface's borders and where they lie on the borders of drawn quads.
#pragma once

#include "quadrig/fit/basis.hpp"

namespace quadrig::detail {

/// A border of drawn quads may stray along the border of the surface, not off it: of each sample two directions across.
class BorderSamples {
 public:
  struct Sample {
    Vector3 position;
    std::array<Vector3, 2> across;  ///< unit, and to the border
    double length = 0;              ///< of the border that the sample stands for
    Index side = no_index;          ///< 4 q + i of a drawn quad q
    double along = 0;               ///< of the side, in [0, 1]
  };

  /// None.
  explicit BorderSamples(const FitBasis& basis) : basis_(basis) {}
  /// \param spacing of the samples, a length; every edge has one
  BorderSamples(const TriangleMesh<double>& surface, const FitBasis& basis, double spacing) : basis_(basis) {
    const DrawnQuads& drawn = basis.drawn();
    std::vector<Index> sides;
    leaving_.assign(static_cast<std::size_t>(drawn.positions().rows()), no_index);
    arriving_ = leaving_;
    for (Index side = 0; side < 4 * drawn.quad_count(); ++side)
      if (drawn.twin(side) == no_index) {
        sides.push_back(side);
        leaving_[at(from(side))] = side;
        arriving_[at(to(side))] = side;
      }
    if (sides.empty()) return;
    std::vector<Index> next(at(surface.vertex_count()), no_index);  // half-edge along the border by its origin
    for (Index h = 0; h < 3 * surface.face_count(); ++h)
      if (surface.twin(h) == no_index) next[at(surface.origin(h))] = h;
    std::vector<char> seen(at(3 * surface.face_count()), 0);
    for (Index first = 0; first < 3 * surface.face_count(); ++first) {
      if (surface.twin(first) != no_index || seen[at(first)]) continue;
      const std::size_t begin = samples_.size();
      for (Index h = first; h != no_index && !seen[at(h)]; h = next[at(surface.target(h))]) {
        seen[at(h)] = 1;
        add_edge(surface.position(surface.origin(h)), surface.position(surface.target(h)), spacing);
      }
      if (begin == samples_.size()) continue;
      start(samples_[begin], sides);
      for (std::size_t s = begin; s < samples_.size(); ++s) {
        if (s > begin) samples_[s].side = samples_[s - 1].side;
        walk(samples_[s]);
      }
    }
    sort_by_quad();
  }

  [[nodiscard]] bool empty() const { return samples_.empty(); }
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

  void add_edge(const Vector3& a, const Vector3& b, double spacing) {
    const double length = (b - a).norm();
    if (!(length > 0)) return;
    const Vector3 tangent = (b - a) / length;
    Eigen::Index least = 0;
    tangent.cwiseAbs().minCoeff(&least);
    const Vector3 one = tangent.cross(Vector3::Unit(least)).normalized();
    const auto count = static_cast<int>(std::clamp(std::ceil(length / spacing), 1.0, 1e4));
    for (int k = 0; k < count; ++k)
      samples_.push_back({a + (k + 0.5) / count * (b - a), {one, tangent.cross(one)}, length / count, no_index, 0});
  }
  /// Squared distance to a side, and where on it.
  [[nodiscard]] std::pair<double, double> nearest(Index side, const Vector3& p) const {
    const Vector3 a = basis_.drawn().position(from(side)), d = basis_.drawn().position(to(side)) - a;
    const double length = d.squaredNorm(), t = length > 0 ? std::clamp((p - a).dot(d) / length, 0.0, 1.0) : 0;
    return {(a + t * d - p).squaredNorm(), t};
  }
  /// The nearest side that runs the same way.
  void start(Sample& sample, const std::vector<Index>& sides) const {
    const Vector3 tangent = sample.across[0].cross(sample.across[1]);
    double best = std::numeric_limits<double>::infinity();
    for (const Index side : sides) {
      const double distance = nearest(side, sample.position).first;
      const Vector3 d = basis_.drawn().position(to(side)) - basis_.drawn().position(from(side));
      if (distance < best && d.dot(tangent) > 0) best = distance, sample.side = side;
    }
  }
  void walk(Sample& sample) const {
    if (sample.side == no_index) return;
    auto [best, along] = nearest(sample.side, sample.position);
    for (const auto step : {&BorderSamples::following, &BorderSamples::preceding})
      for (;;) {
        const Index side = (this->*step)(sample.side);
        if (side == no_index) break;
        const auto [distance, there] = nearest(side, sample.position);
        if (!(distance < best)) break;
        sample.side = side, best = distance, along = there;
      }
    sample.along = along;
  }
  [[nodiscard]] Index following(Index side) const { return leaving_[at(to(side))]; }
  [[nodiscard]] Index preceding(Index side) const { return arriving_[at(from(side))]; }

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
  std::vector<Index> leaving_, arriving_;  // border sides by the drawn vertex where they begin, or end
  std::vector<std::size_t> first_, by_quad_;
};

}  // namespace quadrig::detail
