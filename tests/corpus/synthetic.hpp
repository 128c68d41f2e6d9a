// Surfaces made by code from seeds, of the kinds that break quad meshers: handles, holes, creases, thin parts, noise,
// needles, uneven sampling, odd units, several parts. The same bits on every machine that rounds alike.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <numbers>
#include <string>

#include "quadrig/mesh.hpp"

namespace quadrig::test {

/// Vertices and triangles, before any check.
struct Soup {
  std::vector<Vector3> points;
  std::vector<std::array<Index, 3>> faces;

  [[nodiscard]] Points<double> positions() const {
    Points<double> p(static_cast<Eigen::Index>(points.size()), 3);
    for (std::size_t v = 0; v < points.size(); ++v) p.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
    return p;
  }
  [[nodiscard]] Triangles triangles() const {
    Triangles t(static_cast<Eigen::Index>(faces.size()), 3);
    for (std::size_t f = 0; f < faces.size(); ++f)
      t.row(static_cast<Eigen::Index>(f)) << faces[f][0], faces[f][1], faces[f][2];
    return t;
  }
};

struct SyntheticCase {
  std::string name;
  std::function<Soup()> make;
};

/// A small generator whose bits do not depend on the standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15u + 1) {}
  std::uint64_t bits() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  /// In [low, high).
  double number(double low = 0, double high = 1) {
    return low + (high - low) * static_cast<double>(bits() >> 11) * 0x1p-53;
  }
  Vector3 direction() {
    for (;;) {
      const Vector3 d(number(-1, 1), number(-1, 1), number(-1, 1));
      if (d.norm() > 0.1 && d.norm() < 1) return d.normalized();
    }
  }

 private:
  std::uint64_t state_;
};

namespace synthetic {

using Distance = std::function<double(const Vector3&)>;

/// Vertices at one position become one; faces that vanish go.
inline Soup welded(const Soup& in) {
  Soup out;
  std::map<std::array<double, 3>, Index> known;
  std::vector<Index> number;
  for (const Vector3& p : in.points) {
    const auto [slot, fresh] =
        known.try_emplace({p[0] + 0.0, p[1] + 0.0, p[2] + 0.0}, static_cast<Index>(out.points.size()));
    if (fresh) out.points.push_back(p);
    number.push_back(slot->second);
  }
  for (const auto& f : in.faces) {
    const std::array<Index, 3> t{number[static_cast<std::size_t>(f[0])], number[static_cast<std::size_t>(f[1])],
                                 number[static_cast<std::size_t>(f[2])]};
    if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) out.faces.push_back(t);
  }
  return out;
}

inline Soup moved(Soup s, const std::function<Vector3(const Vector3&)>& map) {
  for (Vector3& p : s.points) p = map(p);
  return s;
}
inline Soup joined(Soup a, const Soup& b) {
  const auto offset = static_cast<Index>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (const auto& f : b.faces) a.faces.push_back({f[0] + offset, f[1] + offset, f[2] + offset});
  return a;
}
inline Soup scaled(Soup s, double factor, const Vector3& offset = Vector3::Zero()) {
  return moved(std::move(s), [&](const Vector3& p) { return Vector3(factor * p + offset); });
}

/// The surface where `f` is zero, by marching tetrahedra on a lattice of cubes of side `step`; outside is f > 0.
inline Soup level_set(const Distance& f, const Vector3& low, const Vector3& high, double step) {
  std::array<Index, 3> n{};
  for (int k = 0; k < 3; ++k) n[static_cast<std::size_t>(k)] = static_cast<Index>(std::ceil((high[k] - low[k]) / step));
  const auto id = [&](Index i, Index j, Index k) { return i + (n[0] + 1) * (j + (n[1] + 1) * k); };
  std::vector<double> value(static_cast<std::size_t>(id(n[0], n[1], n[2]) + 1));
  const auto point = [&](Index i, Index j, Index k) {
    return Vector3(low + step * Vector3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)));
  };
  for (Index k = 0; k <= n[2]; ++k)
    for (Index j = 0; j <= n[1]; ++j)
      for (Index i = 0; i <= n[0]; ++i) {
        double& d = value[static_cast<std::size_t>(id(i, j, k))];
        d = f(point(i, j, k));
        if (std::abs(d) < 1e-3 * step) d = d < 0 ? -1e-3 * step : 1e-3 * step;
      }
  Soup out;
  std::map<std::pair<Index, Index>, Index> cuts;
  const auto cut = [&](Index a, const Vector3& pa, Index b, const Vector3& pb) {
    const auto [slot, fresh] = cuts.try_emplace(std::minmax(a, b), static_cast<Index>(out.points.size()));
    if (fresh) {
      const double da = value[static_cast<std::size_t>(a)], db = value[static_cast<std::size_t>(b)];
      out.points.push_back(pa + da / (da - db) * (pb - pa));
    }
    return slot->second;
  };
  // Six tetrahedra about the diagonal of each cube, all of one orientation.
  static constexpr std::array<std::array<int, 4>, 6> tetrahedra{
      {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
  for (Index k = 0; k < n[2]; ++k)
    for (Index j = 0; j < n[1]; ++j)
      for (Index i = 0; i < n[0]; ++i) {
        std::array<Index, 8> ids{};
        std::array<Vector3, 8> p;
        for (int c = 0; c < 8; ++c) {
          const auto at = static_cast<std::size_t>(c);
          ids[at] = id(i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2));
          p[at] = point(i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2));
        }
        for (const auto& tetrahedron : tetrahedra) {
          std::vector<int> in, outside;
          for (const int c : tetrahedron)
            (value[static_cast<std::size_t>(ids[static_cast<std::size_t>(c)])] < 0 ? in : outside).push_back(c);
          if (in.empty() || outside.empty()) continue;
          const auto edge = [&](int a, int b) {
            const auto x = static_cast<std::size_t>(a), y = static_cast<std::size_t>(b);
            return cut(ids[x], p[x], ids[y], p[y]);
          };
          std::vector<Index> ring;
          if (in.size() == 1)
            ring = {edge(in[0], outside[0]), edge(in[0], outside[1]), edge(in[0], outside[2])};
          else if (outside.size() == 1)
            ring = {edge(in[0], outside[0]), edge(in[1], outside[0]), edge(in[2], outside[0])};
          else
            ring = {edge(in[0], outside[0]), edge(in[0], outside[1]), edge(in[1], outside[1]), edge(in[1], outside[0])};
          Vector3 inside = Vector3::Zero(), beyond = Vector3::Zero(), normal = Vector3::Zero();
          for (const int c : in) inside += p[static_cast<std::size_t>(c)] / static_cast<double>(in.size());
          for (const int c : outside) beyond += p[static_cast<std::size_t>(c)] / static_cast<double>(outside.size());
          const auto at = [&](std::size_t r) { return out.points[static_cast<std::size_t>(ring[r])]; };
          for (std::size_t r = 1; r + 1 < ring.size(); ++r) normal += (at(r) - at(0)).cross(at(r + 1) - at(0));
          if (normal.dot(beyond - inside) < 0) std::reverse(ring.begin(), ring.end());
          for (std::size_t r = 1; r + 1 < ring.size(); ++r) out.faces.push_back({ring[0], ring[r], ring[r + 1]});
        }
      }
  return out;
}

/// Keeps where `f` is negative; triangles across are cut along the zero line.
inline Soup clipped(const Soup& in, const Distance& f) {
  Soup out;
  std::vector<double> value;
  for (const Vector3& p : in.points) {
    const double d = f(p);
    value.push_back(std::abs(d) < 1e-9 ? -1e-9 : d);
  }
  out.points = in.points;
  std::map<std::pair<Index, Index>, Index> cuts;
  const auto cut = [&](Index a, Index b) {
    const auto [slot, fresh] = cuts.try_emplace(std::minmax(a, b), static_cast<Index>(out.points.size()));
    if (fresh) {
      const auto [x, y] = std::minmax(a, b);
      const double dx = value[static_cast<std::size_t>(x)], dy = value[static_cast<std::size_t>(y)];
      const Vector3 px = in.points[static_cast<std::size_t>(x)], py = in.points[static_cast<std::size_t>(y)];
      out.points.push_back(px + dx / (dx - dy) * (py - px));
    }
    return slot->second;
  };
  for (const auto& face : in.faces) {
    std::vector<Index> ring;
    for (std::size_t i = 0; i < 3; ++i) {
      const Index a = face[i], b = face[(i + 1) % 3];
      const bool keep_a = value[static_cast<std::size_t>(a)] < 0, keep_b = value[static_cast<std::size_t>(b)] < 0;
      if (keep_a) ring.push_back(a);
      if (keep_a != keep_b) ring.push_back(cut(a, b));
    }
    for (std::size_t r = 1; r + 1 < ring.size(); ++r) out.faces.push_back({ring[0], ring[r], ring[r + 1]});
  }
  Soup compact;
  std::vector<Index> number(out.points.size(), no_index);
  for (auto& face : out.faces)
    for (Index& v : face) {
      Index& k = number[static_cast<std::size_t>(v)];
      if (k == no_index) {
        k = static_cast<Index>(compact.points.size());
        compact.points.push_back(out.points[static_cast<std::size_t>(v)]);
      }
      v = k;
    }
  compact.faces = std::move(out.faces);
  return compact;
}

/// A grid of quads over [0, 1]², each cut in two, along alternating diagonals where `alternating`.
inline Soup sheet(Index columns, Index rows, const std::function<Vector3(double, double)>& map,
                  bool alternating = false) {
  Soup out;
  for (Index j = 0; j <= rows; ++j)
    for (Index i = 0; i <= columns; ++i)
      out.points.push_back(map(static_cast<double>(i) / columns, static_cast<double>(j) / rows));
  for (Index j = 0; j < rows; ++j)
    for (Index i = 0; i < columns; ++i) {
      const Index a = i + j * (columns + 1), b = a + 1, d = a + columns + 1, c = d + 1;
      if (alternating && ((i + j) & 1)) {
        out.faces.push_back({a, b, d});
        out.faces.push_back({b, c, d});
      } else {
        out.faces.push_back({a, b, c});
        out.faces.push_back({a, c, d});
      }
    }
  return out;
}

/// Revolution of a profile (radius, height) about z in `n` steps; radius 0 is a pole; closed profiles end where they
/// began. The outside is to the right of the profile as it runs.
inline Soup revolved(const std::vector<std::array<double, 2>>& profile, Index n) {
  Soup out;
  std::vector<Index> first;
  const bool closed = profile.front() == profile.back();
  const std::size_t rings = closed ? profile.size() - 1 : profile.size();
  for (std::size_t r = 0; r < rings; ++r) {
    first.push_back(static_cast<Index>(out.points.size()));
    const bool pole = profile[r][0] == 0;
    for (Index i = 0; i < (pole ? 1 : n); ++i) {
      const double a = 2 * std::numbers::pi * i / n;
      out.points.emplace_back(profile[r][0] * std::cos(a), profile[r][0] * std::sin(a), profile[r][1]);
    }
  }
  for (std::size_t r = 0; r + 1 < profile.size(); ++r) {
    const std::size_t s = (r + 1) % rings;
    const bool low_pole = profile[r][0] == 0, high_pole = profile[s][0] == 0;
    for (Index i = 0; i < n; ++i) {
      const Index j = (i + 1) % n;
      const Index a = first[r] + (low_pole ? 0 : i), b = first[r] + (low_pole ? 0 : j);
      const Index d = first[s] + (high_pole ? 0 : i), c = first[s] + (high_pole ? 0 : j);
      if (!low_pole) out.faces.push_back({a, b, c});
      if (!high_pole) out.faces.push_back({a, c, d});
    }
  }
  return out;
}

/// A profile with steps of at most `step` between its corners.
inline std::vector<std::array<double, 2>> stepped(const std::vector<std::array<double, 2>>& corners, double step) {
  std::vector<std::array<double, 2>> out;
  for (std::size_t k = 0; k + 1 < corners.size(); ++k) {
    const double length = std::hypot(corners[k + 1][0] - corners[k][0], corners[k + 1][1] - corners[k][1]);
    const int n = std::max(1, static_cast<int>(std::ceil(length / step)));
    for (int i = 0; i < n; ++i) {
      const double t = static_cast<double>(i) / n;
      out.push_back({corners[k][0] + t * (corners[k + 1][0] - corners[k][0]),
                     corners[k][1] + t * (corners[k + 1][1] - corners[k][1])});
    }
  }
  out.push_back(corners.back());
  return out;
}

/// The outside of a set of unit cells, each face cut into n×n quads of two triangles.
inline Soup cells(const std::vector<std::array<int, 3>>& filled, Index n) {
  const auto has = [&](int x, int y, int z) {
    return std::find(filled.begin(), filled.end(), std::array<int, 3>{x, y, z}) != filled.end();
  };
  Soup out;
  for (const auto& [x, y, z] : filled)
    for (int axis = 0; axis < 3; ++axis)
      for (const int side : {0, 1}) {
        std::array<int, 3> across{x, y, z};
        across[static_cast<std::size_t>(axis)] += side ? 1 : -1;
        if (has(across[0], across[1], across[2])) continue;
        const Vector3 base = Vector3(x, y, z) + side * Vector3::Unit(axis);
        const Vector3 u = Vector3::Unit((axis + (side ? 1 : 2)) % 3), v = Vector3::Unit((axis + (side ? 2 : 1)) % 3);
        out = joined(std::move(out), sheet(n, n, [&](double s, double t) {
                       // Exact multiples of 1/n on both sides of an edge, so that welding finds them.
                       return Vector3(base + std::round(s * n) / n * u + std::round(t * n) / n * v);
                     }));
      }
  return welded(out);
}

/// Straight prism over a star-shaped outline, from an inner outline of as many corners: a ring with creases.
inline Soup ring_prism(const std::vector<std::array<double, 2>>& outer, const std::vector<std::array<double, 2>>& inner,
                       double height, Index radial, Index layers) {
  const auto n = static_cast<Index>(outer.size());
  Soup out;
  // One closed loop of (radial, height) positions, revolved along the outlines.
  std::vector<std::array<double, 2>> loop;
  for (Index k = 0; k < radial; ++k) loop.push_back({static_cast<double>(k) / radial, 0});
  for (Index k = 0; k < layers; ++k) loop.push_back({1, height * k / layers});
  for (Index k = radial; k > 0; --k) loop.push_back({static_cast<double>(k) / radial, height});
  for (Index k = layers; k > 0; --k) loop.push_back({0, height * k / layers});
  const auto m = static_cast<Index>(loop.size());
  for (Index i = 0; i < n; ++i)
    for (const auto& [t, z] : loop) {
      const auto& a = inner[static_cast<std::size_t>(i)];
      const auto& b = outer[static_cast<std::size_t>(i)];
      out.points.emplace_back(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), z);
    }
  for (Index i = 0; i < n; ++i)
    for (Index k = 0; k < m; ++k) {
      const Index a = i * m + k, b = (i + 1) % n * m + k, c = (i + 1) % n * m + (k + 1) % m, d = i * m + (k + 1) % m;
      out.faces.push_back({a, b, c});
      out.faces.push_back({a, c, d});
    }
  return out;
}

inline Distance ball(const Vector3& c, double r) {
  return [=](const Vector3& p) { return (p - c).norm() - r; };
}
inline Distance capsule(const Vector3& a, const Vector3& b, double ra, double rb) {
  return [=](const Vector3& p) {
    const Vector3 d = b - a;
    const double t = std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
    return (p - a - t * d).norm() - (ra + t * (rb - ra));
  };
}
inline Distance torus(const Vector3& c, double large, double small) {
  return [=](const Vector3& p) {
    const Vector3 q = p - c;
    return std::hypot(std::hypot(q[0], q[1]) - large, q[2]) - small;
  };
}
inline Distance box(const Vector3& c, const Vector3& half, double radius = 0) {
  return [=](const Vector3& p) {
    const Vector3 q = (p - c).cwiseAbs() - half + Vector3::Constant(radius);
    return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0) - radius;
  };
}
/// Smooth minimum over a length k.
inline Distance any_of(std::vector<Distance> parts, double k = 0) {
  return [=](const Vector3& p) {
    double d = std::numeric_limits<double>::infinity();
    for (const Distance& part : parts) {
      const double e = part(p);
      const double h = k > 0 ? std::max(k - std::abs(d - e), 0.0) / k : 0.0;
      d = std::isinf(d) ? e : std::min(d, e) - h * h * k / 4;
    }
    return d;
  };
}
inline Distance without(Distance a, Distance b) {
  return [=](const Vector3& p) { return std::max(a(p), -b(p)); };
}

/// Vertices at random within `amount` of their mean edge length.
inline Soup noisy(Soup s, double amount, std::uint64_t seed) {
  double total = 0;
  for (const auto& f : s.faces)
    total += (s.points[static_cast<std::size_t>(f[0])] - s.points[static_cast<std::size_t>(f[1])]).norm();
  const double mean = total / static_cast<double>(s.faces.size());
  Random random(seed);
  for (Vector3& p : s.points)
    p += amount * mean * Vector3(random.number(-1, 1), random.number(-1, 1), random.number(-1, 1));
  return s;
}

/// Some triangles get a vertex `nearness` of its height away from an edge (caps and needles on the same surface).
inline Soup with_slivers(Soup s, double share, double nearness, std::uint64_t seed) {
  Random random(seed);
  const std::size_t count = s.faces.size();
  for (std::size_t f = 0; f < count; ++f) {
    if (random.number() > share) continue;
    const auto t = s.faces[f];
    const Vector3 a = s.points[static_cast<std::size_t>(t[0])], b = s.points[static_cast<std::size_t>(t[1])],
                  c = s.points[static_cast<std::size_t>(t[2])];
    const double x = random.number(0.02, 0.98);
    const auto v = static_cast<Index>(s.points.size());
    s.points.push_back((1 - nearness) * ((1 - x) * a + x * b) + nearness * c);
    s.faces[f] = {t[0], t[1], v};
    s.faces.push_back({t[1], t[2], v});
    s.faces.push_back({t[2], t[0], v});
  }
  return s;
}

/// Each triangle that `inside` likes is cut in three at its centre, `rounds` times: 1 : 3^rounds in area.
inline Soup crowded(Soup s, const Distance& inside, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    const std::size_t count = s.faces.size();
    for (std::size_t f = 0; f < count; ++f) {
      const auto t = s.faces[f];
      const Vector3 c = (s.points[static_cast<std::size_t>(t[0])] + s.points[static_cast<std::size_t>(t[1])] +
                         s.points[static_cast<std::size_t>(t[2])]) /
                        3;
      if (inside(c) > 0) continue;
      const auto v = static_cast<Index>(s.points.size());
      s.points.push_back(c);
      s.faces[f] = {t[0], t[1], v};
      s.faces.push_back({t[1], t[2], v});
      s.faces.push_back({t[2], t[0], v});
    }
  }
  return s;
}

/// Faces beside the border removed at random, as long as the rest stays one manifold piece of the same kind.
inline Soup ragged(Soup s, double share, std::uint64_t seed) {
  Random random(seed);
  std::map<std::pair<Index, Index>, int> count;
  const auto key = [](Index a, Index b) { return std::pair{std::min(a, b), std::max(a, b)}; };
  for (const auto& f : s.faces)
    for (std::size_t i = 0; i < 3; ++i) ++count[key(f[i], f[(i + 1) % 3])];
  std::vector<char> border(s.points.size(), 0);
  const auto mark = [&] {
    std::fill(border.begin(), border.end(), char{0});
    for (const auto& [edge, n] : count)
      if (n == 1) border[static_cast<std::size_t>(edge.first)] = border[static_cast<std::size_t>(edge.second)] = 1;
  };
  for (int round = 0; round < 3; ++round) {
    mark();
    std::vector<std::array<Index, 3>> kept;
    for (const auto& f : s.faces) {
      int open = 0, opposite = 0;
      for (std::size_t i = 0; i < 3; ++i)
        if (count[key(f[i], f[(i + 1) % 3])] == 1) {
          ++open;
          opposite = static_cast<int>((i + 2) % 3);
        }
      const auto tip = static_cast<std::size_t>(f[static_cast<std::size_t>(opposite)]);
      // One open edge and an inner vertex across: taking the face keeps the border one simple loop.
      if (open == 1 && !border[tip] && random.number() < share) {
        for (std::size_t i = 0; i < 3; ++i) --count[key(f[i], f[(i + 1) % 3])];
        for (const Index v : f) border[static_cast<std::size_t>(v)] = 1;
        continue;
      }
      kept.push_back(f);
    }
    s.faces = std::move(kept);
  }
  return s;
}

inline Soup sphere(Index n) {
  std::vector<std::array<double, 2>> profile;
  for (Index k = 0; k <= n; ++k) {
    const double a = std::numbers::pi * k / n;
    profile.push_back({k == 0 || k == n ? 0.0 : std::sin(a), -std::cos(a)});
  }
  return revolved(profile, 2 * n);
}
inline Soup torus_mesh(Index n, Index m, double large, double small) {
  std::vector<std::array<double, 2>> profile;
  for (Index k = 0; k < m; ++k) {
    const double a = 2 * std::numbers::pi * k / m;
    profile.push_back({large + small * std::cos(a), small * std::sin(a)});
  }
  profile.push_back(profile.front());
  return revolved(profile, n);
}

/// A closed or open tube of radius r(t) about a curve, t in [0, 1].
inline Soup tube(const std::function<Vector3(double)>& curve, const std::function<double(double)>& radius, Index along,
                 Index around, bool closed) {
  Soup out;
  Vector3 side = Vector3(0.3, 0.5, 0.8);
  const Index rings = closed ? along : along + 1;
  std::vector<Vector3> sides, normals;
  for (Index i = 0; i < rings; ++i) {
    const double t = static_cast<double>(i) / along;
    const Vector3 tangent = (curve(t + 1e-4) - curve(t - 1e-4)).normalized();
    side = (side - side.dot(tangent) * tangent).normalized();
    sides.push_back(side);
    normals.push_back(tangent.cross(side));
  }
  // A closed tube comes back turned; the turn is spread along it.
  double turn = 0;
  if (closed) {
    const Vector3 tangent = (curve(1e-4) - curve(-1e-4)).normalized();
    const Vector3 last = (side - side.dot(tangent) * tangent).normalized();
    turn = std::atan2(last.dot(normals[0]), last.dot(sides[0]));
  }
  for (Index i = 0; i < rings; ++i) {
    const double t = static_cast<double>(i) / along;
    for (Index j = 0; j < around; ++j) {
      const double a = 2 * std::numbers::pi * j / around - turn * t;
      const auto k = static_cast<std::size_t>(i);
      out.points.push_back(curve(t) + radius(t) * (std::cos(a) * sides[k] + std::sin(a) * normals[k]));
    }
  }
  for (Index i = 0; i < along; ++i)
    for (Index j = 0; j < around; ++j) {
      const Index i2 = closed ? (i + 1) % along : i + 1, j2 = (j + 1) % around;
      const Index a = i * around + j, b = i * around + j2, c = i2 * around + j2, d = i2 * around + j;
      out.faces.push_back({a, b, c});
      out.faces.push_back({a, c, d});
    }
  if (!closed)
    for (const bool end : {false, true}) {
      const auto centre = static_cast<Index>(out.points.size());
      out.points.push_back(curve(end ? 1.0 : 0.0));
      const Index base = end ? along * around : 0;
      for (Index j = 0; j < around; ++j) {
        const Index a = base + j, b = base + (j + 1) % around;
        if (end)
          out.faces.push_back({a, b, centre});
        else
          out.faces.push_back({b, a, centre});
      }
    }
  return out;
}

inline Soup bumpy(const Soup& s, double height, double frequency, std::uint64_t seed) {
  Random random(seed);
  std::array<Vector3, 6> wave;
  std::array<double, 6> phase{};
  for (std::size_t k = 0; k < 6; ++k) {
    wave[k] = frequency * random.number(0.5, 1.5) * random.direction();
    phase[k] = random.number(0, 6.28);
  }
  return moved(s, [&](const Vector3& p) {
    double d = 0;
    for (std::size_t k = 0; k < 6; ++k) d += std::sin(wave[k].dot(p) + phase[k]);
    return Vector3(p + height / 6 * d * p.normalized());
  });
}

/// Balls joined smoothly at random places; limbs that leave a body.
inline Soup creature(int limbs, double thickness, double step, std::uint64_t seed) {
  Random random(seed);
  std::vector<Distance> parts{capsule({-0.4, 0, 0}, {0.4, 0, 0}, 0.3, 0.25)};
  for (int k = 0; k < limbs; ++k) {
    const Vector3 root(random.number(-0.4, 0.4), 0, 0), out = random.direction();
    const Vector3 knee = root + 0.6 * out, foot = knee + 0.5 * (out + 0.8 * random.direction()).normalized();
    parts.push_back(capsule(root, knee, 1.3 * thickness, thickness));
    parts.push_back(capsule(knee, foot, thickness, 0.7 * thickness));
  }
  return level_set(any_of(parts, 0.08), Vector3::Constant(-1.7), Vector3::Constant(1.7), step);
}

inline Soup hand(double finger, double step) {
  std::vector<Distance> parts{box({0, 0, 0}, {0.4, 0.4, 0.12}, 0.1)};
  for (int k = 0; k < 4; ++k)
    parts.push_back(capsule({-0.33 + 0.22 * k, 0.35, 0}, {-0.4 + 0.27 * k, 1.1 - 0.1 * std::abs(k - 1.4), 0.1}, finger,
                            0.8 * finger));
  parts.push_back(capsule({0.35, -0.1, 0}, {0.8, 0.3, 0.15}, 1.2 * finger, finger));
  return level_set(any_of(parts, 0.05), Vector3(-0.75, -0.55, -0.35), Vector3(1.05, 1.35, 0.4), step);
}

/// A row of rings joined: one handle each.
inline Soup handles(int genus, double step) {
  std::vector<Distance> parts;
  for (int k = 0; k < genus; ++k) parts.push_back(torus({1.5 * k, 0, 0}, 0.8, 0.25));
  return level_set(any_of(parts, 0.15), Vector3(-1.2, -1.2, -0.5), Vector3(1.5 * (genus - 1) + 1.2, 1.2, 0.5), step);
}

inline Distance holes_in_ball(int holes, double radius) {
  return [=](const Vector3& p) {
    double d = -1;
    for (int k = 0; k < holes; ++k) {
      const double a = 2.399963 * k, z = holes == 1 ? 1.0 : 0.8 - 1.6 * k / (holes - 1);
      const double r = std::sqrt(std::max(0.0, 1 - z * z));
      d = std::max(d, radius - (p - Vector3(r * std::cos(a), r * std::sin(a), z)).norm());
    }
    return d;
  };
}

inline std::vector<std::array<double, 2>> circle(double r, Index n) {
  std::vector<std::array<double, 2>> out;
  for (Index k = 0; k < n; ++k)
    out.push_back({r * std::cos(2 * std::numbers::pi * k / n), r * std::sin(2 * std::numbers::pi * k / n)});
  return out;
}
inline std::vector<std::array<double, 2>> gear_outline(int teeth, double low, double high) {
  std::vector<std::array<double, 2>> out;
  const Index n = teeth * 8;
  for (Index k = 0; k < n; ++k) {
    const double a = 2 * std::numbers::pi * k / n, r = (k / 4) % 2 == 0 ? high : low;
    out.push_back({r * std::cos(a), r * std::sin(a)});
  }
  return out;
}

}  // namespace synthetic

/// Every case, in a fixed order; names say what is hard about it.
inline std::vector<SyntheticCase> synthetic_cases() {
  using namespace synthetic;
  std::vector<SyntheticCase> list;
  const auto add = [&](std::string name, std::function<Soup()> make) {
    list.push_back({std::move(name), std::move(make)});
  };
  const auto text = [](double x) {
    std::string s = std::to_string(x);
    while (s.back() == '0') s.pop_back();
    if (s.back() == '.') s.pop_back();
    return s;
  };

  // Closed, smooth, genus 0 to 5.
  for (const Index n : {6, 16, 48}) add("sphere_" + std::to_string(n), [=] { return sphere(n); });
  add("ellipsoid_flat",
      [] { return moved(sphere(32), [](const Vector3& p) { return Vector3(p[0], p[1], 0.15 * p[2]); }); });
  add("ellipsoid_long",
      [] { return moved(sphere(32), [](const Vector3& p) { return Vector3(0.1 * p[0], 0.1 * p[1], p[2]); }); });
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U})
    add("bumpy_" + std::to_string(seed), [=] { return bumpy(sphere(40), 0.35, 5, seed); });
  add("torus_fat", [] { return torus_mesh(64, 32, 1, 0.45); });
  add("torus_thin", [] { return torus_mesh(128, 12, 1, 0.05); });
  add("torus_coarse", [] { return torus_mesh(8, 5, 1, 0.4); });
  for (int g = 1; g <= 5; ++g) add("handles_" + std::to_string(g), [=] { return handles(g, 0.09); });
  for (int g = 2; g <= 5; g += 3) add("handles_fine_" + std::to_string(g), [=] { return handles(g, 0.05); });
  add("genus_5_lattice", [] {
    return level_set(
        any_of(
            {torus({0, 0, 0.4}, 0.8, 0.12), torus({0, 0, -0.4}, 0.8, 0.12),
             capsule({0.8, 0, -0.4}, {0.8, 0, 0.4}, 0.12, 0.12), capsule({-0.8, 0, -0.4}, {-0.8, 0, 0.4}, 0.12, 0.12),
             capsule({0, 0.8, -0.4}, {0, 0.8, 0.4}, 0.12, 0.12), capsule({0, -0.8, -0.4}, {0, -0.8, 0.4}, 0.12, 0.12)},
            0.05),
        Vector3(-1.1, -1.1, -0.7), Vector3(1.1, 1.1, 0.7), 0.055);
  });
  add("knot", [] {
    return tube(
        [](double t) {
          const double a = 2 * std::numbers::pi * t;
          return Vector3(std::sin(a) + 2 * std::sin(2 * a), std::cos(a) - 2 * std::cos(2 * a), -std::sin(3 * a));
        },
        [](double) { return 0.3; }, 200, 16, true);
  });

  // Thin limbs, fingers, spikes.
  for (const std::uint64_t seed : {1U, 2U, 3U})
    add("creature_" + std::to_string(seed), [=] { return creature(5, 0.09, 0.05, seed); });
  for (const std::uint64_t seed : {4U, 5U})
    add("creature_thin_" + std::to_string(seed), [=] { return creature(6, 0.035, 0.03, seed); });
  add("hand", [] { return hand(0.1, 0.04); });
  add("hand_thin", [] { return hand(0.05, 0.03); });
  add("spike", [] {
    return moved(sphere(32),
                 [](const Vector3& p) { return Vector3(p + (p[2] > 0.9 ? 40 * (p[2] - 0.9) : 0) * Vector3(0, 0, 1)); });
  });
  add("spring", [] {
    return tube([](double t) { return Vector3(std::cos(30 * t), std::sin(30 * t), 2 * t); },
                [](double) { return 0.08; }, 300, 10, false);
  });
  add("rod_100",
      [] { return tube([](double t) { return Vector3(100 * t, 0, 0); }, [](double) { return 0.5; }, 400, 12, false); });
  add("taper", [] {
    return tube([](double t) { return Vector3(4 * t, 0.3 * std::sin(6 * t), 0); },
                [](double t) { return 0.4 * (1 - t) + 0.004; }, 120, 16, false);
  });
  add("horns", [] {
    return level_set(any_of({ball({0, 0, 0}, 0.5), capsule({0, 0, 0.3}, {0.6, 0, 1.4}, 0.12, 0.02),
                             capsule({0, 0, 0.3}, {-0.6, 0, 1.4}, 0.12, 0.02)},
                            0.1),
                     Vector3(-0.9, -0.7, -0.7), Vector3(0.9, 0.7, 1.6), 0.045);
  });

  // Solids with creases.
  add("tetrahedron", [] {
    return Soup{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}};
  });
  for (const Index n : {1, 3, 12}) add("cube_" + std::to_string(n), [=] { return cells({{0, 0, 0}}, n); });
  add("box_long", [] {
    return moved(cells({{0, 0, 0}}, 12), [](const Vector3& p) { return Vector3(10 * p[0], p[1], 0.5 * p[2]); });
  });
  for (const double t : {0.05, 0.01, 0.001})
    add("plate_" + text(t), [=] {
      return moved(cells({{0, 0, 0}}, 16), [=](const Vector3& p) { return Vector3(p[0], p[1], t * p[2]); });
    });
  add("wedge", [] {
    return moved(cells({{0, 0, 0}}, 12),
                 [](const Vector3& p) { return Vector3(p[0], p[1], p[2] * (0.02 + 0.5 * p[0])); });
  });
  add("pyramid", [] { return revolved(stepped({{0, 0}, {1, 0}, {0, 1.5}}, 0.1), 4); });
  add("prism", [] { return revolved(stepped({{0, 0}, {1, 0}, {1, 2}, {0, 2}}, 0.1), 3); });
  add("hexagon", [] { return revolved(stepped({{0, 0}, {1, 0}, {1, 0.6}, {0, 0.6}}, 0.06), 6); });
  add("l_shape", [] { return cells({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 8); });
  add("t_shape", [] { return cells({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 1, 0}, {1, 2, 0}}, 6); });
  add("u_shape", [] { return cells({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {2, 1, 0}}, 6); });
  add("stairs", [] { return cells({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 0, 1}, {1, 0, 1}, {0, 0, 2}}, 6); });
  add("frame", [] {
    std::vector<std::array<int, 3>> c;
    for (int x = 0; x < 3; ++x)
      for (int y = 0; y < 3; ++y)
        if (x != 1 || y != 1) c.push_back({x, y, 0});
    return cells(c, 5);
  });
  for (int g = 2; g <= 4; ++g)
    add("ladder_" + std::to_string(g), [=] {
      std::vector<std::array<int, 3>> c;
      for (int x = 0; x < 2 * g + 1; ++x)
        for (int y = 0; y < 3; ++y)
          if (x % 2 == 0 || y != 1) c.push_back({x, y, 0});
      return cells(c, 4);
    });
  add("cage", [] {
    std::vector<std::array<int, 3>> c;
    for (int x = 0; x < 3; ++x)
      for (int y = 0; y < 3; ++y)
        for (int z = 0; z < 3; ++z)
          if ((x == 1) + (y == 1) + (z == 1) < 2) c.push_back({x, y, z});
    return cells(c, 3);
  });
  add("cylinder", [] { return revolved(stepped({{0, 0}, {1, 0}, {1, 2}, {0, 2}}, 0.12), 40); });
  add("disc_thick", [] { return revolved(stepped({{0, 0}, {1, 0}, {1, 0.1}, {0, 0.1}}, 0.05), 48); });
  add("cone", [] { return revolved(stepped({{0, 0}, {1, 0}, {0, 2}}, 0.1), 40); });
  add("cone_sharp", [] { return revolved(stepped({{0, 0}, {0.2, 0}, {0, 4}}, 0.1), 24); });
  add("pipe", [] { return revolved(stepped({{0.6, 0}, {1, 0}, {1, 2}, {0.6, 2}, {0.6, 0}}, 0.12), 40); });
  add("washer", [] { return revolved(stepped({{0.5, 0}, {1, 0}, {1, 0.05}, {0.5, 0.05}, {0.5, 0}}, 0.05), 60); });
  add("bolt", [] { return revolved(stepped({{0, 0}, {0.4, 0}, {0.4, 2}, {1, 2}, {1, 2.4}, {0, 2.4}}, 0.1), 36); });
  add("vase", [] {
    std::vector<std::array<double, 2>> p{{0, 0}};
    for (int k = 0; k <= 24; ++k) p.push_back({0.5 + 0.25 * std::sin(0.25 * k), 0.08 * k});
    for (int k = 24; k >= 1; --k) p.push_back({0.45 + 0.25 * std::sin(0.25 * k), 0.08 * k + 0.02});
    p.push_back({0, 0.1});
    return revolved(p, 40);
  });
  for (const int teeth : {6, 12, 24})
    add("gear_" + std::to_string(teeth),
        [=] { return ring_prism(gear_outline(teeth, 0.8, 1), circle(0.35, teeth * 8), 0.3, 6, 4); });
  add("block_with_holes", [] {
    Distance d = box({0, 0, 0}, {1.5, 0.5, 0.25});
    for (int k = 0; k < 3; ++k) {
      const Vector3 c(-1.0 + k, 0, 0);
      d = without(d, [=](const Vector3& p) { return std::hypot(p[0] - c[0], p[1] - c[1]) - 0.28; });
    }
    return level_set(d, Vector3(-1.7, -0.7, -0.4), Vector3(1.7, 0.7, 0.4), 0.055);
  });
  add("crossed_cylinders", [] {
    return level_set(
        any_of({[](const Vector3& p) { return std::max(std::hypot(p[0], p[1]) - 0.4, std::abs(p[2]) - 1); },
                [](const Vector3& p) { return std::max(std::hypot(p[0], p[2]) - 0.3, std::abs(p[1]) - 1); }}),
        Vector3(-0.6, -1.2, -1.2), Vector3(0.6, 1.2, 1.2), 0.06);
  });
  add("dented_cube", [] {
    return level_set(without(box({0, 0, 0}, {0.7, 0.7, 0.7}), ball({0.7, 0.7, 0.7}, 0.6)), Vector3::Constant(-0.85),
                     Vector3::Constant(0.85), 0.055);
  });

  // Noise, as scanners leave it.
  for (const double amount : {0.1, 0.3}) add("scan_ball_" + text(amount), [=] { return noisy(sphere(40), amount, 7); });
  add("scan_torus", [] { return noisy(torus_mesh(80, 36, 1, 0.4), 0.25, 8); });
  add("scan_cube", [] { return noisy(cells({{0, 0, 0}}, 16), 0.25, 9); });
  add("scan_creature", [] { return noisy(creature(4, 0.1, 0.05, 11), 0.15, 10); });
  add("scan_rough", [] { return bumpy(noisy(sphere(48), 0.2, 12), 0.2, 25, 13); });
  add("scan_sheet", [] {
    return noisy(sheet(40, 40, [](double s, double t) { return Vector3(s, t, 0.1 * std::sin(7 * s)); }), 0.25, 14);
  });

  // Uneven sampling, needles, caps.
  add("sampling_1000_sheet", [] {
    return sheet(40, 40, [](double s, double t) {
      return Vector3((std::pow(1000, s) - 1) / 999, (std::pow(1000, t) - 1) / 999, 0.1 * s * t);
    });
  });
  add("sampling_1000_ball", [] {
    return moved(sphere(40), [](const Vector3& p) {
      const double a = std::acos(std::clamp(p[2], -1.0, 1.0)) / std::numbers::pi,
                   b = (std::pow(1000, a) - 1) / 999 * std::numbers::pi;
      const Vector3 flat(p[0], p[1], 0);
      return Vector3(flat.norm() > 0 ? Vector3(flat.normalized() * std::sin(b) + std::cos(b) * Vector3(0, 0, 1)) : p);
    });
  });
  add("crowded_torus", [] { return crowded(torus_mesh(24, 12, 1, 0.4), ball({1, 0, 0}, 0.4), 5); });
  add("crowded_cube", [] { return crowded(cells({{0, 0, 0}}, 4), ball({1, 1, 1}, 0.5), 6); });
  add("needle_tube",
      [] { return tube([](double t) { return Vector3(4 * t, 0, 0); }, [](double) { return 0.5; }, 4, 200, false); });
  add("needle_rings",
      [] { return tube([](double t) { return Vector3(4 * t, 0, 0); }, [](double) { return 0.5; }, 600, 6, false); });
  for (const double nearness : {0.1, 0.01, 0.0001})
    add("slivers_ball_" + text(nearness), [=] { return with_slivers(sphere(24), 0.3, nearness, 21); });
  add("slivers_cube", [] { return with_slivers(cells({{0, 0, 0}}, 8), 0.4, 0.005, 22); });
  add("slivers_torus", [] { return with_slivers(torus_mesh(32, 16, 1, 0.4), 0.5, 0.001, 23); });
  add("slivers_twice",
      [] { return with_slivers(with_slivers(torus_mesh(32, 16, 1, 0.4), 0.4, 0.02, 24), 0.3, 0.02, 25); });
  add("fan_disc", [] { return revolved(std::vector<std::array<double, 2>>{{0, 0}, {1, 0}, {0, 0.5}}, 300); });

  // Units.
  for (const double unit : {1e-6, 1e6}) {
    const std::string u = unit < 1 ? "tiny" : "huge";
    add("units_" + u + "_bumpy", [=] { return scaled(bumpy(sphere(30), 0.3, 4, 31), unit); });
    add("units_" + u + "_cube", [=] { return scaled(cells({{0, 0, 0}}, 8), unit); });
    add("units_" + u + "_sheet",
        [=] { return scaled(sheet(20, 20, [](double s, double t) { return Vector3(s, t, 0.2 * s * t); }), unit); });
  }
  add("far_from_origin", [] { return scaled(bumpy(sphere(30), 0.3, 4, 32), 1, Vector3(1e5, -2e5, 3e5)); });

  // Open: sheets, annuli, discs with holes, shells with holes.
  add("triangle", [] { return Soup{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}; });
  add("sliver", [] { return sheet(1, 1, [](double s, double t) { return Vector3(s, 1e-5 * t, 0); }); });
  add("square_2", [] { return sheet(1, 1, [](double s, double t) { return Vector3(s, t, 0); }); });
  add("square_flat", [] { return sheet(24, 24, [](double s, double t) { return Vector3(s, t, 0); }); });
  add("strip",
      [] { return sheet(100, 2, [](double s, double t) { return Vector3(20 * s, 0.4 * t, std::sin(8 * s)); }); });
  add("saddle", [] {
    return sheet(30, 30, [](double s, double t) { return Vector3(2 * s - 1, 2 * t - 1, (2 * s - 1) * (2 * t - 1)); });
  });
  add("waves", [] {
    return sheet(50, 50, [](double s, double t) { return Vector3(s, t, 0.06 * std::sin(20 * s) * std::sin(15 * t)); });
  });
  add("skewed", [] { return sheet(24, 24, [](double s, double t) { return Vector3(s + 0.8 * t, 0.4 * t, 0); }); });
  add("half_tube", [] {
    return sheet(30, 30, [](double s, double t) { return Vector3(std::cos(3.1 * s), std::sin(3.1 * s), 3 * t); });
  });
  add("rolled", [] {
    return sheet(120, 20, [](double s, double t) {
      return Vector3((0.2 + s) * std::cos(15 * s), (0.2 + s) * std::sin(15 * s), t);
    });
  });
  for (const std::uint64_t seed : {41U, 42U, 43U})
    add("ragged_" + std::to_string(seed), [=] {
      return ragged(sheet(
                        24, 24, [](double s, double t) { return Vector3(s, t, 0.2 * std::sin(4 * s)); }, seed % 2 == 0),
                    0.4, seed);
    });
  add("ragged_fine", [] {
    return ragged(sheet(60, 60, [](double s, double t) { return Vector3(s, t, 0.1 * std::cos(5 * s * t)); }), 0.5, 44);
  });
  add("disc", [] {
    return clipped(sheet(30, 30, [](double s, double t) { return Vector3(2 * s - 1, 2 * t - 1, 0); }),
                   ball({0, 0, 0}, 0.93));
  });
  add("disc_of_fan", [] { return revolved(stepped({{0, 0}, {1, 0}}, 0.1), 32); });
  for (const double inner : {0.1, 0.5, 0.9})
    add("annulus_" + text(inner), [=] { return revolved(stepped({{inner, 0}, {1, 0}}, 0.06), 60); });
  add("tube_open", [] { return revolved(stepped({{1, 0}, {1, 3}}, 0.15), 32); });
  add("cone_open", [] { return revolved(stepped({{0.05, 0}, {1, 2}}, 0.1), 32); });
  add("star_sheet", [] {
    return clipped(
        sheet(50, 50, [](double s, double t) { return Vector3(2 * s - 1, 2 * t - 1, 0); }),
        [](const Vector3& p) { return std::hypot(p[0], p[1]) - 0.6 - 0.25 * std::cos(5 * std::atan2(p[1], p[0])); });
  });
  for (int holes = 1; holes <= 6; ++holes) {
    add("ball_holes_" + std::to_string(holes), [=] { return clipped(sphere(36), holes_in_ball(holes, 0.4)); });
    add("cheese_" + std::to_string(holes), [=] {
      Random random(static_cast<std::uint64_t>(50 + holes));
      std::vector<Distance> cuts;
      for (int k = 0; k < holes; ++k) {
        const double a = 2 * std::numbers::pi * k / holes;
        cuts.push_back(ball({0.55 * std::cos(a), 0.55 * std::sin(a), 0}, random.number(0.08, 0.22)));
      }
      return clipped(sheet(45, 45, [](double s, double t) { return Vector3(2 * s - 1, 2 * t - 1, 0); }),
                     without(ball({0, 0, 0}, 0.95), any_of(cuts)));
    });
  }
  for (int holes = 1; holes <= 3; ++holes)
    add("torus_holes_" + std::to_string(holes), [=] {
      return clipped(torus_mesh(60, 28, 1, 0.4), [=](const Vector3& p) {
        double d = -1;
        for (int k = 0; k < holes; ++k) {
          const double a = 2 * std::numbers::pi * k / holes;
          d = std::max(d, 0.3 - (p - Vector3(1.4 * std::cos(a), 1.4 * std::sin(a), 0)).norm());
        }
        return d;
      });
    });
  add("cube_open", [] { return clipped(cells({{0, 0, 0}}, 10), [](const Vector3& p) { return p[2] - 0.95; }); });
  add("mask", [] {
    return clipped(clipped(bumpy(sphere(40), 0.2, 4, 61), [](const Vector3& p) { return -p[2]; }),
                   any_of({[](const Vector3& p) { return 0.18 - (p - Vector3(0.35, 0.3, p[2])).norm(); }}));
  });
  add("glove", [] { return clipped(hand(0.09, 0.04), [](const Vector3& p) { return -0.3 - p[1]; }); });
  add("plane_with_slit", [] {
    return clipped(sheet(41, 41, [](double s, double t) { return Vector3(2 * s - 1, 2 * t - 1, 0); }),
                   without([](const Vector3&) { return -1.0; }, box({0, 0, 0}, {0.6, 0.03, 1})));
  });

  // Several parts.
  add("parts_equal", [] {
    Soup s;
    for (int k = 0; k < 4; ++k)
      s = joined(std::move(s),
                 scaled(bumpy(sphere(14), 0.3, 4, static_cast<std::uint64_t>(70 + k)), 1, Vector3(3.0 * k, 0, 0)));
    return s;
  });
  add("parts_of_all_sizes", [] {
    Soup s;
    for (int k = 0; k < 5; ++k) s = joined(std::move(s), scaled(sphere(14), std::pow(0.3, k), Vector3(2.0 * k, 0, 0)));
    return s;
  });
  add("parts_nested", [] {
    Soup inner = scaled(sphere(16), 0.5);
    for (auto& f : inner.faces) std::swap(f[1], f[2]);
    return joined(sphere(24), inner);
  });
  add("parts_mixed", [] {
    Soup s = torus_mesh(30, 14, 1, 0.3);
    s = joined(std::move(s), scaled(cells({{0, 0, 0}}, 6), 1, Vector3(2, 0, 0)));
    s = joined(std::move(s),
               scaled(sheet(12, 12, [](double a, double b) { return Vector3(a, b, 0.2 * a); }), 2, Vector3(0, 3, 0)));
    return joined(std::move(s), scaled(revolved(stepped({{0.3, 0}, {1, 0}}, 0.1), 24), 1, Vector3(-3, 0, 0)));
  });
  add("parts_many", [] {
    Soup s;
    for (int k = 0; k < 40; ++k) s = joined(std::move(s), scaled(sphere(5), 0.4, Vector3(k % 8, k / 8, 0)));
    return s;
  });
  add("parts_eyes", [] {
    Soup s = bumpy(sphere(30), 0.2, 3, 81);
    for (const double x : {-0.35, 0.35}) s = joined(std::move(s), scaled(sphere(10), 0.08, Vector3(x, 0.3, 1.1)));
    return s;
  });
  return list;
}

}  // namespace quadrig::test
