// Tips and corners of a surface that its quads cut off: a vertex of the quads goes there and stays.
#pragma once

#include <numbers>

#include "quadrig/pipeline.hpp"
#include "quadrig/polish.hpp"
#include "quadrig/quality/coverage.hpp"

namespace quadrig::detail {

/// Which points of a surface get a vertex, in edges of quads.
struct LandingLimits {
  double missed = 0.75;  ///< any point of the surface farther than this from the quads
  double tip = 0.15;     ///< a sharp one
  double apart = 1;      ///< two that land in one round
  double least = 0.15;   ///< scaled Jacobian that quads keep
  double even = 0.3;     ///< below this whole quads are drawn to the tip rather than a corner moved there
  double drawn = 0.25;   ///< of the distance of that quad's corners from the tip is left
  double cap = 1.2;      ///< times that distance: what is nearer is drawn as much
  double reach = 3;      ///< times that: what is farther stays
  int rounds = 3;
};

/// Moves vertices of quads onto the points that these miss, farthest first, with the quads around polished after them.
class Landing {
 public:
  /// Keeps references to `surface`, `kept` and `context`. \param edge of a quad
  Landing(const TriangleMesh<double>& surface, const EdgeMarks& kept, double edge, const PolishOptions& polish,
          Context& context)
      : surface_(surface), kept_(kept), edge_(edge), polish_(polish), context_(context) {
    for (Index f = 0; f < surface.face_count(); ++f) faces_.push_back(f);
    std::vector<double> angle(at(surface.vertex_count()), 0.0);
    for (Index h = 0; h < surface.halfedge_count(); ++h) {
      const Vector3 u = surface.edge_vector(h), w = -surface.edge_vector(3 * (h / 3) + (h + 2) % 3);
      angle[at(surface.origin(h))] += elementary::atan2(u.cross(w).norm(), u.dot(w));
    }
    constexpr double missing = 0.4 * std::numbers::pi;  // of the full circle: a corner of a cube lacks half of π
    for (Index v = 0; v < surface.vertex_count(); ++v)
      tip_.push_back(!surface.on_boundary(v) && angle[at(v)] < 2 * std::numbers::pi - missing);
  }

  /// What the quads miss, once vertices have landed.
  [[nodiscard]] Coverage run(QuadMesh& quads, double& least) {
    Coverage covered = measure(quads);
    landed.assign(at(quads.vertex_count()), 0);
    for (int round = 0; round < limits_.rounds && !context_.cancelled(); ++round) {
      const std::vector<Index> missed = missed_points();
      if (missed.empty() || is_rough(missed, quads)) break;
      QuadMesh changed = quads;
      std::vector<char> held = landed;
      if (land(missed, changed, held) == 0) break;
      PolishedQuads polished = polish(surface_, polish_, std::move(changed), context_, kept_, held);
      if (polished.report.least_after < std::min(limits_.least, least)) break;
      const Coverage better = measure(polished.mesh);
      if (!(better.farthest < covered.farthest || better.share_beyond <= covered.share_beyond)) break;
      quads = std::move(polished.mesh);
      least = polished.report.least_after;
      landed = std::move(held);
      covered = better;
    }
    return covered;
  }

  std::vector<char> landed;  ///< a flag a vertex of the quads

 private:
  [[nodiscard]] Coverage measure(const QuadMesh& quads) {
    off_.assign(at(surface_.vertex_count()), 0.0);
    return coverage(surface_, faces_, quads.positions, quads.quads, edge_, context_, off_);
  }

  /// Whether so many points are missed that they are no tips but the roughness of all of the surface.
  [[nodiscard]] bool is_rough(const std::vector<Index>& missed, const QuadMesh& quads) const {
    constexpr std::size_t few = 16;
    constexpr double share = 0.02;  // of the quads
    return missed.size() > few + static_cast<std::size_t>(share * quads.quad_count()) &&
           off_[at(missed.front())] < ComponentReport::most_edges_off * edge_;
  }

  /// Vertices of the surface that no quad comes near, the farthest first.
  [[nodiscard]] std::vector<Index> missed_points() const {
    std::vector<Index> missed;
    for (Index v = 0; v < surface_.vertex_count(); ++v)
      if (!surface_.on_boundary(v) && off_[at(v)] > (tip_[at(v)] ? limits_.tip : limits_.missed) * edge_)
        missed.push_back(v);
    std::stable_sort(missed.begin(), missed.end(), [&](Index a, Index b) { return off_[at(a)] > off_[at(b)]; });
    return missed;
  }

  /// How many points got a vertex.
  [[nodiscard]] Index land(const std::vector<Index>& missed, QuadMesh& quads, std::vector<char>& held) {
    const Triangles halves = quad_halves(quads.quads);
    const ClosestPoint tree(quads.positions, halves);
    const QuadCorners corners(quads);
    std::vector<char> fixed = held;
    for_each_edge(sorted_by_edge(quads.vertex_count(), quads.quads), [&](std::span<const SortedSide> side) {
      if (side.size() == 1) fixed[at(side[0].low)] = fixed[at(side[0].high)] = 1;
    });
    if (!kept_.empty()) {
      constexpr double near = 1e-6;
      const EdgeCurves curves(surface_, kept_);
      for (Index v = 0; v < quads.vertex_count(); ++v)
        if (curves.under(quads.source[at(v)], near) != no_index) fixed[at(v)] = 1;
    }
    std::vector<Vector3> taken;
    Index landings = 0;
    for (const Index w : missed) {
      const Vector3 p = surface_.position(w);
      if (std::any_of(taken.begin(), taken.end(),
                      [&](const Vector3& t) { return (t - p).norm() < limits_.apart * edge_; }))
        continue;
      taken.push_back(p);
      landings += take(tree.closest(p).face / 2, w, corners, quads, fixed, held);
    }
    return landings;
  }

  /// Of the quads at v. \pre none of them is degenerate
  [[nodiscard]] static double least_at(Index v, const QuadCorners& corners, const QuadMesh& quads) {
    double least = 1;
    for (const Index c : corners.at(v))
      least = std::min(least, scaled_jacobian(quads.positions, quads.quads.row(c / 4)));
    return least;
  }

  /// Brings a quad to vertex w of the surface: the corner that leaves the quads around it most even, or, where that
  /// would crush some, the quads around w, drawn towards it. What moved is held. Returns whether anything did.
  bool take(Index quad, Index w, const QuadCorners& corners, QuadMesh& quads, std::vector<char>& fixed,
            std::vector<char>& held) const {
    const Vector3 p = surface_.position(w);
    Index best = no_index;
    double most = limits_.least;
    for (int i = 0; i < 4; ++i) {
      const Index v = quads.quads(quad, i);
      if (fixed[at(v)]) continue;
      const Vector3 home = quads.positions.row(v).transpose();
      quads.positions.row(v) = p.transpose();
      if (const double least = least_at(v, corners, quads); least > most) most = least, best = v;
      quads.positions.row(v) = home.transpose();
    }
    if (most < limits_.even)
      for (const double left : {limits_.drawn, 2 * limits_.drawn})
        for (const double reach : {limits_.reach, limits_.reach / 2})
          if (draw(quad, p, left, reach, corners, quads, fixed, held)) return true;
    if (best == no_index) return false;
    quads.positions.row(best) = p.transpose();
    const Index h = surface_.outgoing(w);
    quads.source[at(best)] = {h / 3, Vector3::Unit(h % 3)};
    fixed[at(best)] = held[at(best)] = 1;
    return true;
  }

  /// Draws the quads around a tip towards it, those next to it most: a cone about the tip stays itself. Those that the
  /// nearest quad spans are held.
  bool draw(Index quad, const Vector3& tip, double left, double reach, const QuadCorners& corners, QuadMesh& quads,
            std::vector<char>& fixed, std::vector<char>& held) const {
    double inner = 0;
    for (int i = 0; i < 4; ++i) inner = std::max(inner, (position_of(quads, quads.quads(quad, i)) - tip).norm());
    inner *= limits_.cap;
    const double outer = reach * inner;
    std::vector<Index> near{quads.quads(quad, 0)};
    std::vector<char> seen(at(quads.vertex_count()), 0);
    seen[at(near[0])] = 1;
    for (std::size_t k = 0; k < near.size(); ++k)
      for (const Index c : corners.at(near[k]))
        for (int i = 0; i < 4; ++i)
          if (const Index v = quads.quads(c / 4, i); !seen[at(v)] && (position_of(quads, v) - tip).norm() < outer) {
            seen[at(v)] = 1;
            near.push_back(v);
          }
    const auto inside = [&](Index v) { return (position_of(quads, v) - tip).norm() <= inner; };
    std::vector<Index> cap;
    std::copy_if(near.begin(), near.end(), std::back_inserter(cap), inside);
    if (std::any_of(near.begin(), near.end(), [&](Index v) { return fixed[at(v)] != 0; })) return false;
    const QuadMesh before = quads;
    double least_before = 1, least = 1;
    for (const Index v : near) least_before = std::min(least_before, least_at(v, corners, quads));
    for (const Index v : near) {
      const Vector3 arm = position_of(before, v) - tip;
      const double out = std::clamp((arm.norm() - inner) / (outer - inner), 0.0, 1.0);
      const SurfaceHit there = walk_closest(surface_, tip + (left + (1 - left) * out) * arm, quads.source[at(v)]);
      quads.positions.row(v) = there.position.transpose();
      quads.source[at(v)] = there;
    }
    for (const Index v : near) least = std::min(least, least_at(v, corners, quads));
    if (least < std::min(limits_.even, least_before)) {
      quads = before;
      return false;
    }
    for (const Index v : cap) fixed[at(v)] = held[at(v)] = 1;
    return true;
  }
  [[nodiscard]] static Vector3 position_of(const QuadMesh& quads, Index v) {
    return quads.positions.row(v).transpose();
  }

  const TriangleMesh<double>& surface_;
  const EdgeMarks& kept_;
  const double edge_;
  const PolishOptions& polish_;
  Context& context_;
  const LandingLimits limits_{};
  std::vector<Index> faces_;
  std::vector<char> tip_;    // a flag a vertex of the surface
  std::vector<double> off_;  // of each vertex of the surface from the quads
};

}  // namespace quadrig::detail
