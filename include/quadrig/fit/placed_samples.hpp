// Samples of a surface and where they lie on drawn quads, as shares of the vertices that the fit moves.
#pragma once

#include "quadrig/fit/basis.hpp"
#include "quadrig/fit/samples.hpp"

namespace quadrig::detail {

class PlacedSamples {
 public:
  /// \param face_weights of the surface, or empty: 1
  /// \param source of the cage's vertices on the surface
  PlacedSamples(const TriangleMesh<double>& surface, SurfaceSamples samples, std::span<const double> face_weights,
                const std::vector<SurfacePoint>& source, FitBasis& basis, Context& context)
      : surface_(surface), basis_(basis), context_(context), samples_(std::move(samples)) {
    if (!face_weights.empty())
      for (std::size_t s = 0; s < samples_.size(); ++s) samples_.area[s] *= face_weights[at(samples_.point[s].face)];
    locate(source);
  }

  [[nodiscard]] std::size_t size() const { return samples_.size(); }
  [[nodiscard]] const SurfacePoint& point(std::size_t s) const { return samples_.point[s]; }
  [[nodiscard]] const Vector3& position(std::size_t s) const { return samples_.position[s]; }
  [[nodiscard]] const Vector3& normal(std::size_t s) const { return samples_.normal[s]; }
  [[nodiscard]] double area(std::size_t s) const { return samples_.area[s]; }
  [[nodiscard]] const Place& place(std::size_t s) const { return places_[s]; }
  [[nodiscard]] bool placed(std::size_t s) const { return places_[s].triangle != no_index; }
  [[nodiscard]] Index quad(std::size_t s) const { return basis_.cage_of(places_[s].triangle / 2); }
  /// Samples that lie on a quad of the cage.
  [[nodiscard]] std::span<const std::size_t> on(Index quad) const {
    return std::span(by_quad_).subspan(first_[at(quad)], first_[at(quad) + 1] - first_[at(quad)]);
  }
  /// Shares of the quad's patch at its k-th sample.
  [[nodiscard]] std::span<const double> shares(Index quad, std::size_t k) const {
    const std::size_t size = basis_.patch(quad).size();
    return std::span(shares_).subspan(share_first_[at(quad)] + k * size, size);
  }
  /// A sample that faces away from its place says nothing about it.
  [[nodiscard]] double weight(std::size_t s) const {
    constexpr double facing = 0.2;
    return basis_.drawn().normal(places_[s].triangle).dot(samples_.normal[s]) > facing ? samples_.area[s] : 0;
  }

  /// New places after the vertices have moved.
  void place(const Points<double>& cage) {
    basis_.set_positions(cage);
    const DrawnQuads& drawn = basis_.drawn();
    context_.parallel_for(places_.size(), 2048, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s)
        if (placed(s)) places_[s] = drawn.walk(samples_.position[s], places_[s].triangle);
    });
    sort_by_quad();
    share_first_.assign(1, 0);
    for (Index q = 0; q < basis_.quad_count(); ++q)
      share_first_.push_back(share_first_.back() + on(q).size() * basis_.patch(q).size());
    shares_.assign(share_first_.back(), 0.0);
    if (basis_.is_flat())
      choose_diagonals();
    else
      share_places();
  }

 private:
  /// Each sample's place on the quads, by way of the surface: a face begins where its neighbour was found, the first
  /// where a vertex lies. So no sample is placed on another sheet that happens to be near.
  void locate(const std::vector<SurfacePoint>& source) {
    const DrawnQuads& drawn = basis_.drawn();
    std::vector<Index> found(at(surface_.face_count()), no_index);
    std::vector<Index> queue;
    for (std::size_t v = 0; v < source.size(); ++v) {
      const auto at_v = drawn.corners().at(basis_.drawn_vertex(static_cast<Index>(v)));
      const Index face = source[v].face;
      if (at_v.empty() || face == no_index || found[at(face)] != no_index) continue;
      found[at(face)] = 2 * (at_v[0] / 4);
      queue.push_back(face);
    }
    for (std::size_t k = 0; k < queue.size(); ++k) {
      if (k % 4096 == 0 && context_.cancelled()) return;
      const Index face = queue[k];
      const SurfacePoint centre{face, Vector3::Constant(1.0 / 3)};
      found[at(face)] = drawn.walk(quadrig::position(surface_, centre), found[at(face)]).triangle;
      for (Index h = 3 * face; h < 3 * face + 3; ++h)
        if (const Index twin = surface_.twin(h); twin != no_index && found[at(twin / 3)] == no_index) {
          found[at(twin / 3)] = found[at(face)];
          queue.push_back(twin / 3);
        }
    }
    places_.resize(samples_.size());
    for (std::size_t s = 0; s < samples_.size(); ++s) places_[s].triangle = found[at(samples_.point[s].face)];
  }

  void sort_by_quad() {
    first_.assign(at(basis_.quad_count()) + 1, 0);
    for (std::size_t s = 0; s < places_.size(); ++s)
      if (placed(s)) ++first_[at(quad(s)) + 1];
    for (std::size_t q = 1; q < first_.size(); ++q) first_[q] += first_[q - 1];
    by_quad_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t s = 0; s < places_.size(); ++s)
      if (placed(s)) by_quad_[next[at(quad(s))]++] = s;
  }
  [[nodiscard]] std::span<double> own_shares(Index quad, std::size_t k) {
    const std::size_t size = basis_.patch(quad).size();
    return std::span(shares_).subspan(share_first_[at(quad)] + k * size, size);
  }
  void share_places() {
    context_.parallel_for(at(basis_.quad_count()), 64, [&](std::size_t begin, std::size_t end) {
      for (Index q = static_cast<Index>(begin); q < static_cast<Index>(end); ++q)
        for (std::size_t k = 0; k < on(q).size(); ++k) {
          const Place& place = places_[on(q)[k]];
          for (int i = 0; i < 3; ++i)
            basis_.add_corner(place.triangle / 2, basis_.drawn().corner(place.triangle, i), place.barycentric[i],
                              own_shares(q, k));
        }
    });
  }

  /// Of both diagonals the one that lies nearer to the surface, as long as neither half folds over the other. Samples
  /// are placed on both: vertices are fitted to the mean of the two, as a choice that differs from quad to quad would
  /// leave its pattern in their lines.
  void choose_diagonals() {
    const auto cubed = [](double x) { return x * x * x; };
    constexpr double worth = 0.95;  // of the error of the first, below which the second is taken
    DrawnQuads& drawn = basis_.drawn();
    context_.parallel_for(at(basis_.quad_count()), 256, [&](std::size_t begin, std::size_t end) {
      std::vector<Place> found[2];
      for (Index q = static_cast<Index>(begin); q < static_cast<Index>(end); ++q) {
        const std::span<const std::size_t> own = on(q);
        double error[2];
        for (int d = 0; d < 2; ++d) {
          drawn.set_diagonal(q, d);
          found[d].clear();
          error[d] = drawn.normal(2 * q).dot(drawn.normal(2 * q + 1)) > 0
                         ? 0
                         : 1e6 * surface_.total_area() * surface_.total_area();
          for (const std::size_t s : own) {
            const Place one = drawn.on(2 * q, samples_.position[s]), other = drawn.on(2 * q + 1, samples_.position[s]);
            const Place& nearer = found[d].emplace_back(other.squared_distance < one.squared_distance ? other : one);
            error[d] += samples_.area[s] * nearer.squared_distance;
          }
        }
        const double sum = error[0] + error[1];
        for (int d = 0; d < 2; ++d) {
          // 1/2 between equals; 0.9 where the other's error is twice as large
          const double ratio = sum > 0 ? error[1 - d] / sum : 0.5,
                       weight = cubed(ratio) / (cubed(ratio) + cubed(1 - ratio));
          for (std::size_t n = 0; n < own.size(); ++n)
            for (int i = 0; i < 3; ++i)
              basis_.add_corner(q, DrawnQuads::corner(found[d][n].triangle, i, d), weight * found[d][n].barycentric[i],
                                own_shares(q, n));
        }
        const int best = error[1] < worth * error[0] ? 1 : 0;
        drawn.set_diagonal(q, best);
        for (std::size_t n = 0; n < own.size(); ++n) places_[own[n]] = found[best][n];
      }
    });
  }

  const TriangleMesh<double>& surface_;
  FitBasis& basis_;
  Context& context_;
  SurfaceSamples samples_;
  std::vector<Place> places_;
  std::vector<std::size_t> first_, by_quad_, share_first_;
  std::vector<double> shares_;
};

}  // namespace quadrig::detail
