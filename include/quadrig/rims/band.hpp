// The band of a surface along a rim: the way of the rim over the faces, and how quads are to run beside it.
#pragma once

#include <map>
#include <queue>

#include "quadrig/constraints/hinges.hpp"
#include "quadrig/rims.hpp"

namespace quadrig {

/// A face beside a rim.
struct BandFace {
  Index face = no_index;
  double distance = 0;              ///< of its centre from the rim
  Vector3 along = Vector3::Zero();  ///< unit, in the plane of the face: as a curve that keeps its distance runs
};

/// Where a rim lies on a surface that it was found on, or on a part of it, or on one that stands for it.
struct RimBand {
  /// Once round over the faces, where the whole rim lies on the surface and its way closes.
  std::optional<FaceLoop> loop;
  std::vector<BandFace> faces;  ///< within reach, connected with the rim
};

namespace detail {

class RimBandFinder {
 public:
  RimBandFinder(const TriangleMesh<double>& mesh, const ClosestPoint& closest, const Rim& rim)
      : mesh_(mesh), closest_(closest), rim_(rim), count_(rim.points.size()) {}

  [[nodiscard]] RimBand run(double reach) {
    RimBand band;
    place();
    bool closes = count_ > 2;
    for (std::size_t i = 0; i < count_; ++i) closes = walk(i) && closes;
    if (closes) band.loop = loop();
    spread(reach);
    for (const auto& [face, sample] : faces_)
      if (const BandFace beside = measure(face, sample, reach); beside.distance <= reach) band.faces.push_back(beside);
    return band;
  }

 private:
  [[nodiscard]] std::size_t after(std::size_t i) const { return i + 1 < count_ ? i + 1 : 0; }
  [[nodiscard]] std::size_t before(std::size_t i) const { return i > 0 ? i - 1 : count_ - 1; }
  [[nodiscard]] Vector3 centre(Index f) const { return position(mesh_, SurfacePoint{f, Vector3::Constant(1.0 / 3)}); }

  /// The face under each point; none where that is not on this surface.
  void place() {
    constexpr double beside = 0.1, facing = 0.3;  // of the rim's length
    for (std::size_t i = 0; i < count_; ++i) {
      ClosestFilter filter;
      filter.maximum_distance = beside * rim_.length;
      if (!rim_.normals.empty()) filter.normal = rim_.normals[i];
      filter.minimum_cosine = facing;
      const SurfaceHit hit = closest_.closest(rim_.points[i], filter);
      under_.push_back(hit.found() ? hit.face : no_index);
    }
  }

  /// Over the faces from under a point to under the next, as straight as edges let. False where there is no such way.
  bool walk(std::size_t i) {
    const Index from = under_[i], to = under_[after(i)];
    if (from == no_index || to == no_index) return false;
    if (from == to) return true;
    constexpr std::size_t most = 2000;
    constexpr double stray = 2;
    const Vector3 a = rim_.points[i], b = rim_.points[after(i)];
    const auto off = [&](const Vector3& p) {
      const double t = std::clamp((p - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
      return (p - a - t * (b - a)).norm();
    };
    struct Reached {
      double cost = 0;
      Index halfedge = no_index;  // that was crossed into the face
      bool done = false;
    };
    std::map<Index, Reached> reached{{from, {}}};
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    queue.push({0, from});
    while (!queue.empty() && reached.size() < most) {
      const auto [cost, f] = queue.top();
      queue.pop();
      if (std::exchange(reached[f].done, true)) continue;
      if (f == to) break;
      for (const Index h : mesh_.halfedges_of(f)) {
        const Index g = mesh_.twin(h);
        if (g == no_index) continue;
        const double next = cost + (centre(g / 3) - centre(f)).norm() + stray * off(centre(g / 3));
        const auto [place, is_new] = reached.try_emplace(g / 3, Reached{next, h, false});
        if (!is_new && (place->second.done || !(next < place->second.cost))) continue;
        place->second = {next, h, false};
        queue.push({next, g / 3});
      }
    }
    const auto end = reached.find(to);
    if (end == reached.end() || !end->second.done) return false;
    std::vector<Index> way;
    for (Index f = to; f != from;) {
      way.push_back(reached[f].halfedge);
      f = way.back() / 3;
    }
    for (std::size_t k = way.size(); k-- > 0;) add(way[k], a, b);
    return true;
  }
  void add(Index h, const Vector3& a, const Vector3& b) {
    if (!way_.crossed.empty() && mesh_.twin(way_.crossed.back()) == h) {  // there and back
      way_.crossed.pop_back();
      way_.where.pop_back();
      return;
    }
    const Vector3 p = mesh_.position(mesh_.origin(h)), edge = mesh_.edge_vector(h);
    constexpr double end = 0.02;
    way_.crossed.push_back(h);
    way_.where.push_back(std::clamp(((a + b) / 2 - p).dot(edge) / std::max(edge.squaredNorm(), 1e-300), end, 1 - end));
  }
  [[nodiscard]] std::optional<FaceLoop> loop() {
    std::size_t first = 0, last = way_.crossed.size();
    while (last - first > 1 && mesh_.twin(way_.crossed[last - 1]) == way_.crossed[first]) ++first, --last;
    FaceLoop loop;
    for (std::size_t k = first; k < last; ++k) {
      loop.crossed.push_back(way_.crossed[k]);
      loop.where.push_back(way_.where[k]);
    }
    return loop.crossed.size() >= 3 ? std::optional(std::move(loop)) : std::nullopt;
  }

  /// The point of the rim nearest to p, from a point of it downhill.
  [[nodiscard]] std::size_t nearest(const Vector3& p, std::size_t sample) const {
    double least = (rim_.points[sample] - p).squaredNorm();
    for (const bool ahead : {true, false})
      for (std::size_t next = sample;;) {
        next = ahead ? after(next) : before(next);
        const double d = (rim_.points[next] - p).squaredNorm();
        if (!(d < least)) break;
        least = d;
        sample = next;
      }
    return sample;
  }

  /// Out from the rim's own faces, each with the point of the rim nearest to it.
  void spread(double reach) {
    std::vector<Index> open;
    const auto visit = [&](Index f, std::size_t sample) {
      const Vector3 p = centre(f);
      const std::size_t found = nearest(p, sample);
      const double d = (rim_.points[found] - p).norm();
      const auto [place, is_new] = faces_.try_emplace(f, found);
      if (!is_new && !(d < (rim_.points[place->second] - p).norm())) return;
      place->second = found;
      open.push_back(f);
    };
    for (std::size_t i = 0; i < count_; ++i)
      if (under_[i] != no_index) visit(under_[i], i);
    for (std::size_t k = 0; k < open.size(); ++k) {
      const Index f = open[k];
      const std::size_t sample = faces_.at(f);
      if ((rim_.points[sample] - centre(f)).norm() > reach + std::sqrt(mesh_.area(f))) continue;
      for (const Index h : mesh_.halfedges_of(f))
        if (const Index g = mesh_.twin(h); g != no_index) visit(g / 3, sample);
    }
  }

  [[nodiscard]] BandFace measure(Index face, std::size_t sample, double reach) const {
    const Vector3 p = centre(face), along = rim_.points[after(sample)] - rim_.points[before(sample)];
    const Vector3 t = along.normalized();
    const double half = along.norm() / 4;
    Vector3 across = p - rim_.points[sample];
    across -= std::clamp(across.dot(t), -half, half) * t;
    BandFace beside{face, across.norm(), Vector3::Zero()};
    const auto corners = mesh_.faces().row(face);
    const Vector3 x = (mesh_.position(corners[1]) - mesh_.position(corners[0])).normalized();
    const Vector3 n = x.cross(mesh_.position(corners[2]) - mesh_.position(corners[0])).normalized(), y = n.cross(x);
    const auto fourth = [](std::complex<double> d) {
      const double size = std::abs(d);
      return size > 0 ? integer_power(d / size, 4) : std::complex<double>(0);
    };
    const Vector3 turned = n.cross(across);
    // Near the rim its own direction, farther off that across the shortest way to it.
    constexpr double own = 0.3;
    const double far_share = std::min(1.0, beside.distance / (own * reach));
    const std::complex<double> sum =
        (1 - far_share) * fourth({t.dot(x), t.dot(y)}) + far_share * fourth({turned.dot(x), turned.dot(y)});
    const Vector3 wanted = far_share < 0.5 ? t : turned;
    double angle = elementary::arg(sum) / 4;
    const elementary::SinCos turn = elementary::sincos(angle);
    const Vector3 arm = turn.cos * x + turn.sin * y;
    if (std::abs(arm.dot(wanted)) < std::abs(n.cross(arm).dot(wanted))) angle += std::numbers::pi / 2;
    if (std::abs(sum) > 0) beside.along = elementary::cos(angle) * x + elementary::sin(angle) * y;
    return beside;
  }

  const TriangleMesh<double>& mesh_;
  const ClosestPoint& closest_;
  const Rim& rim_;
  const std::size_t count_;
  std::vector<Index> under_;
  FaceLoop way_;
  std::map<Index, std::size_t> faces_;
};

}  // namespace detail

/// The band of faces within `reach` of a rim. \cost O(m log m) for m faces of the band
[[nodiscard]] inline RimBand rim_band(const TriangleMesh<double>& mesh, const ClosestPoint& closest, const Rim& rim,
                                      double reach) {
  return detail::RimBandFinder(mesh, closest, rim).run(reach);
}

}  // namespace quadrig
