// Integer vectors on the edges of a coarse map: what they cost, and whether triangles and cones are right.
#pragma once

#include "quadrig/quantize/rings.hpp"

namespace quadrig::detail {

class IntegerEdges {
 public:
  /// All zero. \param rings of the map, which the energy asks to close: near_rings
  /// \param scale of the map, at which it has the wanted number of quads
  IntegerEdges(const CoarseMap& map, const std::vector<Index>& index, const std::vector<char>& on_border,
               const std::vector<Ring>& rings, double scale)
      : map_(map), index_(index), on_border_(on_border), rings_(rings) {
    const Index n = map.halfedge_count();
    wanted_.resize(at(n));
    weight_.resize(at(n));
    omega_.assign(at(n), Gaussian{});
    for (Index h = 0; h < n; ++h) {
      wanted_[at(h)] = scale * map.vector[at(h)];
      weight_[at(h)].fill(relative(h));
    }
    weigh_shear();
    weigh_rings(scale);
  }

  [[nodiscard]] bool cones_right() const {
    for (Index h = 0; h < map_.halfedge_count(); ++h)
      if (!cone_right(h)) return false;
    return true;
  }
  [[nodiscard]] double quads() const {
    double total = 0;
    for (Index f = 0; f < map_.face_count(); ++f) total += static_cast<double>(area(f));
    return total / 2;
  }
  /// Σ of the squared relative errors alone.
  [[nodiscard]] double energy() const {
    double total = 0;
    for (Index h = 0; h < map_.halfedge_count(); ++h)
      if (map_.twin[at(h)] == no_index || map_.twin[at(h)] > h)
        total += relative(h) * std::norm(to_field(omega_[at(h)]) - wanted_[at(h)]);
    return total;
  }
  /// Dirichlet energy of the change over all triangles, with shear weighted `turning` times stretch. Independent of
  /// quad size.
  [[nodiscard]] double distortion() const {
    double total = 0;
    for (Index f = 0; f < map_.face_count(); ++f) {
      const Complex a = wanted_[at(3 * f)], b = wanted_[at(3 * f + 1)];
      const double det = cross(a, b);
      if (!(det > 1e-9)) continue;
      const Complex ea = to_field(omega_[at(3 * f)]) - a, eb = to_field(omega_[at(3 * f + 1)]) - b;
      const auto slope = [&](double along_a, double along_b) {
        return std::pair{(along_a * b.imag() - along_b * a.imag()) / det,
                         (along_b * a.real() - along_a * b.real()) / det};
      };
      const auto [xx, xy] = slope(ea.real(), eb.real());
      const auto [yx, yy] = slope(ea.imag(), eb.imag());
      total += det / 2 * (xx * xx + yy * yy + turning * (xy * xy + yx * yx));
    }
    return total;
  }
  /// Σ over the rings of their squared slopes, as the energy counts them.
  [[nodiscard]] double spirals() const {
    double total = 0;
    for (std::size_t ring = 0; ring < rings_.size(); ++ring) {
      const auto off = static_cast<double>(pitch(ring));
      total += ring_weight_[ring] * off * off;
    }
    return total;
  }
  [[nodiscard]] const std::vector<Gaussian>& edges() const { return omega_; }

  /// Whether every ring that the map closes is closed.
  [[nodiscard]] bool demands_met() const {
    for (std::size_t ring = 0; ring < rings_.size(); ++ring)
      if (rings_[ring].closed() && pitch(ring) != 0) return false;
    return true;
  }

 protected:
  static constexpr double turning = 4;  // weight of shear against stretch

  [[nodiscard]] static Gaussian axis(int a) { return rotated(Gaussian{1, 0}, a); }
  [[nodiscard]] static Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
  [[nodiscard]] static Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }

  [[nodiscard]] double relative(Index h) const { return 1 / std::max(std::norm(wanted_[at(h)]), 1e-4); }
  /// Next to the relative error of each edge a part of the Dirichlet energy of the change. There what turns the edges
  /// of quads counts more than what stretches them: where the ends of a limb's long edges are off by one row, its rings
  /// become spirals.
  void weigh_shear() {
    constexpr double part = 0.05;
    std::vector<std::array<double, 2>> cotangent(weight_.size(), {0, 0});
    for (Index h = 0; h < map_.halfedge_count(); ++h) {
      const Complex a = -wanted_[at(next(h))], b = wanted_[at(prev(h))];
      const double area = 2 * std::max(std::abs(cross(a, b)), 1e-9);
      const double x = a.real() * b.real() / area, y = a.imag() * b.imag() / area;
      const std::array<double, 2> own{turning * x + y, x + turning * y};
      cotangent[at(h)][0] += own[0];
      cotangent[at(h)][1] += own[1];
      if (const Index g = map_.twin[at(h)]; g != no_index) {
        const bool odd = (map_.rotation[at(h)] & 1) != 0;
        cotangent[at(g)][0] += own[odd];
        cotangent[at(g)][1] += own[!odd];
      }
    }
    for (std::size_t h = 0; h < weight_.size(); ++h)
      for (std::size_t c = 0; c < 2; ++c) weight_[h][c] += part * std::clamp(cotangent[h][c], 0.05, 3 * turning);
  }

  void set(Index h, Gaussian w) {
    omega_[at(h)] = w;
    if (const Index g = map_.twin[at(h)]; g != no_index) omega_[at(g)] = -rotated(w, map_.rotation[at(h)]);
  }
  [[nodiscard]] Gaussian sum(Index f) const {
    return omega_[at(3 * f)] + omega_[at(3 * f + 1)] + omega_[at(3 * f + 2)];
  }
  [[nodiscard]] std::int64_t area(Index f) const { return cross(omega_[at(3 * f)], omega_[at(3 * f + 1)]); }
  [[nodiscard]] double cost(Index h, Gaussian w) const {
    const Complex off = to_field(w) - wanted_[at(h)];
    const auto& [x, y] = weight_[at(h)];
    return x * off.real() * off.real() + y * off.imag() * off.imag();
  }
  /// Energy that ω_h + i^a adds.
  [[nodiscard]] double change(Index h, int a) const {
    return cost(h, omega_[at(h)] + axis(a)) - cost(h, omega_[at(h)]);
  }
  [[nodiscard]] bool forbidden(Index h, int a) const {
    const Aligned aligned = map_.aligned[at(h)];
    if (aligned == Aligned::none) return false;
    return (aligned == Aligned::v_constant) == ((a & 1) != 0);
  }
  [[nodiscard]] bool cone_right(Index h) const {
    constexpr double half_pi = 1.57079632679489661923;
    const Index v = map_.origin[at(h)];
    Index start = h;
    if (on_border_[at(v)])
      while (map_.twin[at(start)] != no_index) start = next(map_.twin[at(start)]);
    double total = 0;
    Index e = start;
    do {
      total += elementary::arg(to_field(-omega_[at(prev(e))]) * std::conj(to_field(omega_[at(e)])));
      e = map_.twin[at(prev(e))];
    } while (e != no_index && e != start);
    const double wanted = (on_border_[at(v)] ? 2 : 4) - index_[at(v)];
    return std::abs(total / half_pi - wanted) < 0.5;
  }

  void weigh_rings(double scale) {
    constexpr double slope =
        2000;  // what a squared slope costs: one row off in 45 as much as one edge off by its length
    const auto states = 4 * omega_.size();
    ring_effect_.assign(rings_.size() * states, 0);
    for (std::size_t ring = 0; ring < rings_.size(); ++ring) {
      constexpr double demanded = 50;  // times as much: more than any bend is worth
      const double length = scale * rings_[ring].length;
      ring_weight_.push_back((rings_[ring].closed() ? demanded : 1) * slope / (length * length));
      for (const auto& [h, turn] : rings_[ring].walk)
        for (int a = 0; a < 4; ++a) {
          const Gaussian gain = axis(a + turn);
          const auto across = static_cast<std::int8_t>(rings_[ring].across(gain.re, gain.im));
          ring_effect_[ring * states + at(4 * h + a)] += across;
          if (const Index other = reversed(4 * h + a); other != no_index)
            ring_effect_[ring * states + at(other)] += across;
        }
      ring_crossings_.emplace_back();
      for (std::size_t node = 0; node < states; ++node)
        if (const int effect = ring_effect_[ring * states + node]; effect != 0)
          ring_crossings_.back().emplace_back(static_cast<Index>(node), std::abs(effect));
    }
  }
  /// How many quads beside its beginning a ring comes back.
  [[nodiscard]] std::int64_t pitch(std::size_t ring) const {
    Gaussian sum{};
    for (const auto& [h, turn] : rings_[ring].walk) sum = sum + rotated(omega_[at(h)], turn & 3);
    return rings_[ring].across(sum.re, sum.im);
  }
  /// The same strip the other way: what the half-edge across receives. no_index on the border.
  [[nodiscard]] Index reversed(Index node) const {
    const Index g = map_.twin[at(node / 4)];
    return g == no_index ? no_index : 4 * g + ((node + 2 + map_.rotation[at(node / 4)]) & 3);
  }

  const CoarseMap& map_;
  const std::vector<Index>& index_;
  const std::vector<char>& on_border_;
  const std::vector<Ring>& rings_;
  std::vector<double> ring_weight_;       // of the squared pitch
  std::vector<std::int8_t> ring_effect_;  // per ring and search node: what it adds to the pitch
  std::vector<std::vector<std::pair<Index, int>>> ring_crossings_;  // per ring: the nodes where that is not 0, its size
  std::vector<Complex> wanted_;
  std::vector<std::array<double, 2>> weight_;  // of the squared error of both components
  std::vector<Gaussian> omega_;
};

}  // namespace quadrig::detail
