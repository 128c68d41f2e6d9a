#pragma once

#include <unordered_map>

#include "quadrig/quads/extract.hpp"

namespace quadrig {

namespace detail {

__extension__ using Int128 = __int128;

[[nodiscard]] inline Int128 exact_cross(Gaussian a, Gaussian b, Gaussian c) {
  return static_cast<Int128>(b.re - a.re) * (c.im - a.im) - static_cast<Int128>(b.im - a.im) * (c.re - a.re);
}
[[nodiscard]] inline int sign(Int128 x) { return (x > 0) - (x < 0); }

struct GridKey {
  int kind;
  Index id;
  Gaussian point;
  friend bool operator==(const GridKey&, const GridKey&) = default;
};
struct GridKeyHash {
  std::size_t operator()(const GridKey& k) const {
    std::uint64_t h = static_cast<std::uint64_t>(k.kind) * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(k.id);
    for (const std::int64_t x : {k.point.re, k.point.im}) {
      h ^= static_cast<std::uint64_t>(x) + 0x9e3779b97f4a7c15u + (h << 6) + (h >> 2);
      h *= 0xff51afd7ed558ccdu;
      h ^= h >> 32;
    }
    return static_cast<std::size_t>(h);
  }
};

class Extractor {
 public:
  explicit Extractor(const GridMap& map) : map_(map) {}

  Expected<ExtractedQuads> run(std::size_t quad_limit) {
    const Index m = map_.face_count();
    const std::int64_t unit = map_.unit, half = unit / 2;
    for (Index f = 0; f < m; ++f) {
      const Gaussian p[3] = {map_.corner[at(3 * f)], map_.corner[at(3 * f + 1)], map_.corner[at(3 * f + 2)]};
      const auto [x_low, x_high] = std::minmax({p[0].re, p[1].re, p[2].re});
      const auto [y_low, y_high] = std::minmax({p[0].im, p[1].im, p[2].im});
      for (std::int64_t x = ceiling(x_low - half, unit) * unit + half; x <= x_high; x += unit) {
        for (std::int64_t y = ceiling(y_low - half, unit) * unit + half; y <= y_high; y += unit) {
          const Gaussian c{x, y};
          if (!owns(f, p, c)) continue;
          if (corners_.size() >= quad_limit)
            return Error{ErrorCode::stage_failed, "more quads than were counted", "extraction", {}};
          std::array<Index, 4> quad{};
          static constexpr std::array<Gaussian, 4> offset{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
          for (std::size_t k = 0; k < 4; ++k) {
            const Gaussian q{x + half * offset[k].re, y + half * offset[k].im};
            const std::optional<Index> vertex = walk(f, c, q);
            if (!vertex)
              return Error{ErrorCode::stage_failed,
                           "a grid line leaves the surface",
                           "extraction, face " + std::to_string(f),
                           {}};
            quad[k] = *vertex;
          }
          corners_.push_back(quad);
        }
      }
    }
    result_.quads.resize(static_cast<Eigen::Index>(corners_.size()), 4);
    for (std::size_t k = 0; k < corners_.size(); ++k)
      for (int i = 0; i < 4; ++i)
        result_.quads(static_cast<Eigen::Index>(k), i) = corners_[k][static_cast<std::size_t>(i)];
    return std::move(result_);
  }

 private:
  [[nodiscard]] static Index next(Index h) { return h % 3 == 2 ? h - 2 : h + 1; }
  [[nodiscard]] static Index prev(Index h) { return h % 3 == 0 ? h + 2 : h - 1; }
  [[nodiscard]] static std::int64_t ceiling(std::int64_t a, std::int64_t b) { return a / b + (a % b > 0 ? 1 : 0); }

  /// Inside; on an edge the lower face owns it, on a vertex the lowest of its fan.
  [[nodiscard]] bool owns(Index f, const Gaussian (&p)[3], Gaussian c) const {
    int zeros = 0, zero_edge = 0, last_zero = 0;
    for (int e = 0; e < 3; ++e) {
      const int s = sign(exact_cross(p[e], p[(e + 1) % 3], c));
      if (s < 0) return false;
      if (s == 0) {
        ++zeros;
        if (zeros == 1) zero_edge = e;
        last_zero = e;
      }
    }
    if (zeros == 0) return true;
    if (zeros == 1) {
      const Index across = map_.twin[at(3 * f + zero_edge)];
      return across == no_index || f < across / 3;
    }
    // The corner shared by the two zero edges.
    const int corner = (zero_edge + 1) % 3 == last_zero ? last_zero : zero_edge;
    const Index start = 3 * f + corner;
    for (Index h = map_.twin[at(prev(start))]; h != no_index && h != start; h = map_.twin[at(prev(h))])
      if (h / 3 < f) return false;
    for (Index h = start;;) {
      const Index g = map_.twin[at(h)];
      if (g == no_index) break;
      h = next(g);
      if (h == start) break;
      if (h / 3 < f) return false;
    }
    return true;
  }

  /// Straight from c in face f to q; the number of the quad vertex there.
  [[nodiscard]] std::optional<Index> walk(Index f, Gaussian c, Gaussian q) {
    Index entry = no_index;
    for (Index steps = 0; steps <= 2 * map_.face_count() + 16; ++steps) {
      const Gaussian p[3] = {map_.corner[at(3 * f)], map_.corner[at(3 * f + 1)], map_.corner[at(3 * f + 2)]};
      Int128 area[3];
      bool inside = true;
      for (int e = 0; e < 3; ++e) {
        area[e] = exact_cross(p[e], p[(e + 1) % 3], q);
        inside = inside && area[e] >= 0;
      }
      if (inside) return vertex_at(f, q, area);
      Index exit = no_index;
      for (int e = 0; e < 3 && exit == no_index; ++e) {
        const Index h = 3 * f + e;
        if (h == entry || area[e] >= 0) continue;
        if (exact_cross(c, q, p[e]) <= 0 && exact_cross(c, q, p[(e + 1) % 3]) >= 0) exit = h;
      }
      if (exit == no_index) return std::nullopt;
      const Index across = map_.twin[at(exit)];
      if (across == no_index) return std::nullopt;
      const int r = map_.rotation[at(exit)];
      const Gaussian t = map_.corner[at(next(across))] - rotated(map_.corner[at(exit)], r);
      c = rotated(c, r) + t;
      q = rotated(q, r) + t;
      entry = across;
      f = across / 3;
    }
    return std::nullopt;
  }

  Index vertex_at(Index f, Gaussian q, const Int128 (&area)[3]) {
    int zeros = 0, zero_edge = 0, other = 0;
    for (int e = 0; e < 3; ++e)
      if (area[e] == 0) {
        if (++zeros == 1) zero_edge = e;
        other = e;
      }
    GridKey key{2, f, q};
    Index coincides = no_index;
    if (zeros == 1) {
      Index h = 3 * f + zero_edge;
      if (const Index g = map_.twin[at(h)]; g != no_index && g < h) {
        const int r = map_.rotation[at(h)];
        q = rotated(q, r) + map_.corner[at(next(g))] - rotated(map_.corner[at(h)], r);
        h = g;
      }
      key = {1, h, q};
    } else if (zeros > 1) {
      const int corner = (zero_edge + 1) % 3 == other ? other : zero_edge;
      coincides = map_.origin[at(3 * f + corner)];
      key = {0, coincides, Gaussian{}};
    }
    const auto [slot, fresh] = numbers_.try_emplace(key, static_cast<Index>(result_.vertices.size()));
    if (fresh) {
      const double total = static_cast<double>(area[0] + area[1] + area[2]);
      SurfacePoint point;
      point.face = f;
      // Edge e is opposite corner e + 2.
      for (int e = 0; e < 3; ++e) point.barycentric[(e + 2) % 3] = static_cast<double>(area[e]) / total;
      result_.vertices.push_back(point);
      result_.mesh_vertex.push_back(coincides);
    }
    return slot->second;
  }

  const GridMap& map_;
  ExtractedQuads result_;
  std::vector<std::array<Index, 4>> corners_;
  std::unordered_map<GridKey, Index, GridKeyHash> numbers_;
};

}  // namespace detail

QUADRIG_INLINE bool grid_map_exact(const GridMap& map) {
  for (Index h = 0; h < static_cast<Index>(map.origin.size()); ++h) {
    const auto at = [](Index i) { return static_cast<std::size_t>(i); };
    const Index n = h % 3 == 2 ? h - 2 : h + 1;
    if (h % 3 == 0 && detail::exact_cross(map.corner[at(h)], map.corner[at(h + 1)], map.corner[at(h + 2)]) <= 0)
      return false;
    const Index g = map.twin[at(h)];
    if (g == no_index) continue;
    const Index gn = g % 3 == 2 ? g - 2 : g + 1;
    const int r = map.rotation[at(h)];
    const Gaussian t = map.corner[at(gn)] - rotated(map.corner[at(h)], r);
    if (!(rotated(map.corner[at(n)], r) + t == map.corner[at(g)])) return false;
    if (t.re % map.unit != 0 || t.im % map.unit != 0) return false;
  }
  return true;
}

QUADRIG_INLINE Expected<ExtractedQuads> extract_quads(const GridMap& map, std::size_t quad_limit) {
  return detail::Extractor(map).run(quad_limit);
}

}  // namespace quadrig
