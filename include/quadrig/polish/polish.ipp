// One vertex at a time, in order: propose the mean of the corners of the rectangles that fit its quads best, project,
// and keep the move only where no quad around becomes worse than allowed.
#pragma once

#include <numbers>

#include "quadrig/polish.hpp"

namespace quadrig {
namespace detail {

class Polisher {
 public:
  Polisher(const TriangleMesh<double>& mesh, const PolishOptions& options, const EdgeMarks& kept,
           std::span<const char> held, QuadMesh& quads)
      : mesh_(mesh), options_(options), quads_(quads), corners_(quads) {
    const auto n = static_cast<std::size_t>(quads.vertex_count());
    rail_.assign(n, no_index);
    fixed_.assign(held.begin(), held.end());
    fixed_.resize(n, 0);
    open_.assign(n, 1);
    if (!mesh.closed()) find_acute();
    if (mesh.closed() && kept.empty()) return;
    curves_.emplace(mesh, joined_marks(border_marks(mesh), kept), EdgeCurves::eighth);
    find_border();
    if (!kept.empty()) find_kept();
  }

  PolishReport run(Context& context) {
    PolishReport report;
    std::tie(report.least_before, report.average_before) = statistics();
    report.rounds += rounds(options_.rounds, context);
    std::tie(report.least_after, report.average_after) = statistics();
    // Quads that no single vertex can improve: even out a patch around them, accept any result, and go on from it.
    for (const int rings : {2, 3, 5, 8}) {
      if (report.least_after > options_.freed || context.cancelled()) break;
      const auto positions = quads_.positions;
      const auto source = quads_.source;
      const auto rail = rail_;
      relax_around(rings);
      report.rounds += rounds(options_.rounds, context);
      const auto [least, average] = statistics();
      if (least > report.least_after) {
        report.least_after = least;
        report.average_after = average;
      } else {
        quads_.positions = positions;
        quads_.source = source;
        rail_ = rail;
      }
    }
    return report;
  }

 private:
  static constexpr double settled = 1e-3;  // a move of less, in edges of quads, is none

  int rounds(int most, Context& context) {
    int done = 0;
    for (; done < most && !context.cancelled(); ++done) {
      double moved = 0;
      for (Index v = 0; v < quads_.vertex_count(); ++v) {
        if (!std::exchange(open_[at(v)], char{0})) continue;
        const double here = move(v);
        moved = std::max(moved, here);
        if (here >= settled) open_around(v);
      }
      if (moved < settled) break;
    }
    return done;
  }
  void open_around(Index v) {
    for (const Index k : corners_.at(v))
      for (int i = 0; i < 4; ++i) open_[at(quads_.quads(k / 4, i))] = 1;
  }

  /// Ten rounds of plain averaging over the vertices within `rings` of the quads that are (nearly) inverted.
  void relax_around(int rings) {
    std::vector<char> patch(at(quads_.vertex_count()), 0);
    for (Index q = 0; q < quads_.quad_count(); ++q)
      if (quality(q) <= options_.freed)
        for (int i = 0; i < 4; ++i) patch[at(quads_.quads(q, i))] = 1;
    for (int ring = 1; ring < rings; ++ring) {
      std::vector<char> grown = patch;
      for (Index q = 0; q < quads_.quad_count(); ++q) {
        bool touches = false;
        for (int i = 0; i < 4; ++i) touches = touches || patch[at(quads_.quads(q, i))];
        for (int i = 0; touches && i < 4; ++i) grown[at(quads_.quads(q, i))] = 1;
      }
      patch = std::move(grown);
    }
    for (int round = 0; round < 10; ++round)
      for (Index v = 0; v < quads_.vertex_count(); ++v) {
        if (!patch[at(v)] || fixed_[at(v)]) continue;
        Vector3 mean = Vector3::Zero();
        double count = 0;
        for (const Index k : corners_.at(v)) {
          const Index q = k / 4;
          const int i = k % 4;
          mean += point(quads_.quads(q, (i + 1) % 4)) + point(quads_.quads(q, (i + 3) % 4));
          count += 2;
        }
        put(v, project(v, mean / count));
      }
    for (Index v = 0; v < quads_.vertex_count(); ++v)
      if (patch[at(v)]) open_around(v);
  }

  struct Place {
    Vector3 position;
    SurfacePoint source;
    Index rail = no_index;  // half-edge of the border, or of what is kept, that it lies on
  };

  [[nodiscard]] Vector3 point(Index v) const { return quads_.positions.row(v).transpose(); }

  /// A quad alone at a corner of the border can be no better than the corner: the sine of its angle is all there is.
  void find_acute() {
    best_.assign(at(quads_.quad_count()), 1);
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      if (corners_.at(v).size() != 1) continue;
      const SurfacePoint& s = quads_.source[at(v)];
      int corner = 0;
      if (s.barycentric.maxCoeff(&corner) < 1 - 1e-9) continue;
      double angle = 0;
      for (const Index h : mesh_.around(mesh_.faces()(s.face, corner))) angle += mesh_.corner_angle(h);
      if (angle >= std::numbers::pi / 2) continue;
      double& best = best_[at(corners_.at(v)[0] / 4)];
      best = std::min(best, std::max(elementary::sin(angle), 1e-9));
    }
  }
  /// What a scaled Jacobian is of what there is.
  [[nodiscard]] double of_best(double jacobian, Index q) const {
    return best_.empty() || jacobian <= 0 ? jacobian : std::min(1.0, jacobian / best_[at(q)]);
  }

  /// Border vertices of the quads slide along border half-edges of the mesh; corners of the border stay.
  void find_border() {
    if (mesh_.closed()) return;
    for_each_edge(sorted_by_edge(quads_.vertex_count(), quads_.quads), [&](std::span<const SortedSide> edge) {
      if (edge.size() != 1) return;
      for (const Index v : {edge[0].low, edge[0].high}) {
        if (rail_[at(v)] != no_index || fixed_[at(v)]) continue;
        const SurfacePoint& s = quads_.source[at(v)];
        for (int e = 0; e < 3; ++e)
          if (mesh_.twin(3 * s.face + e) == no_index && s.barycentric[(e + 2) % 3] <= 1e-9)
            rail_[at(v)] = 3 * s.face + e;
        if (rail_[at(v)] == no_index) {  // at a vertex of the mesh, seen from a face inside
          int corner = 0;
          s.barycentric.maxCoeff(&corner);
          const Index w = mesh_.faces()(s.face, corner);
          if (mesh_.on_boundary(w) && s.barycentric[corner] > 1 - 1e-9) rail_[at(v)] = mesh_.outgoing(w);
        }
        if (rail_[at(v)] == no_index || corners_.at(v).size() != 2) fixed_[at(v)] = 1;
      }
    });
  }

  /// Vertices on kept edges slide along them; those at corners of these, or where other than four quads meet, stay.
  void find_kept() {
    constexpr double near = 1e-6;
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      const SurfacePoint& s = quads_.source[at(v)];
      int corner = 0;
      if (s.barycentric.maxCoeff(&corner) >= 1 - near && curves_->corner(mesh_.faces()(s.face, corner)))
        fixed_[at(v)] = 1;
      if (fixed_[at(v)] || rail_[at(v)] != no_index) continue;
      rail_[at(v)] = curves_->under(s, near);
      if (rail_[at(v)] != no_index && corners_.at(v).size() != 4) fixed_[at(v)] = 1;
    }
  }

  [[nodiscard]] Place project(Index v, const Vector3& p) const {
    if (rail_[at(v)] == no_index) {
      const SurfaceHit hit = walk_closest(mesh_, p, quads_.source[at(v)]);
      return {hit.position, SurfacePoint{hit.face, hit.barycentric}, no_index};
    }
    // Along the curve: from edge to edge as long as it comes closer.
    const auto on_edge = [&](Index h) {
      const Vector3 a = mesh_.position(mesh_.origin(h)), d = mesh_.edge_vector(h);
      const double length = d.squaredNorm();
      const double t = length > 0 ? std::clamp((p - a).dot(d) / length, 0.0, 1.0) : 0.0;
      Place place{a + t * d, {h / 3, Vector3::Zero()}, h};
      place.source.barycentric[h % 3] = 1 - t;
      place.source.barycentric[(h % 3 + 1) % 3] = t;
      return place;
    };
    Place best = on_edge(rail_[at(v)]);
    for (const bool forward : {true, false}) {
      Index h = rail_[at(v)];
      for (int step = 0; step < 64; ++step) {
        h = curves_->beside(h, forward);
        if (h == no_index) break;
        const Place next = on_edge(h);
        if ((next.position - p).squaredNorm() > (best.position - p).squaredNorm() && step > 0) break;
        if ((next.position - p).squaredNorm() < (best.position - p).squaredNorm()) best = next;
      }
    }
    return best;
  }

  /// Corner i of the rectangle that fits quad q: its middle lines turned apart until they are orthogonal.
  [[nodiscard]] Vector3 rectangle_corner(Index q, int i) const {
    Vector3 p[4];
    for (int k = 0; k < 4; ++k) p[k] = point(quads_.quads(q, k));
    const Vector3 center = (p[0] + p[1] + p[2] + p[3]) / 4;
    const Vector3 e = (p[1] + p[2] - p[0] - p[3]) / 2, g = (p[2] + p[3] - p[0] - p[1]) / 2;
    const double length_e = e.norm(), length_g = g.norm();
    if (!(length_e > 0) || !(length_g > 0)) return p[i];
    const Vector3 a = e / length_e, b = g / length_g;
    const Vector3 sum = a + b, difference = a - b;
    if (!(sum.norm() > 1e-6) || !(difference.norm() > 1e-6)) return p[i];
    const Vector3 s = sum.normalized(), d = difference.normalized();
    const Vector3 x = (s + d) * (length_e / 2 / std::sqrt(2.0)), y = (s - d) * (length_g / 2 / std::sqrt(2.0));
    const double sign_x = i == 1 || i == 2 ? 1 : -1, sign_y = i >= 2 ? 1 : -1;
    return center + sign_x * x + sign_y * y;
  }

  /// Least scaled Jacobian of the quads at v. One that is turned against the surface counts as just inverted, so that
  /// nothing is turned over while it is sound, and nothing is crushed in order to be turned back.
  [[nodiscard]] double least(Index v) const {
    constexpr double turned = -0.05;
    double worst = 1;
    // On a rim both sides are the surface's.
    const SurfacePoint& here = quads_.source[at(v)];
    std::array<Index, 4> sides{here.face, no_index, no_index, no_index};
    for (int i = 0; i < 3; ++i)
      if (const Index g = mesh_.twin(3 * here.face + i); g != no_index && here.barycentric[(i + 2) % 3] < 0.05)
        sides[static_cast<std::size_t>(i + 1)] = g / 3;
    for (const Index k : corners_.at(v)) {
      const Index q = k / 4;
      const Eigen::Matrix<Index, 1, 4> quad = quads_.quads.row(q);
      double j = of_best(scaled_jacobian(quads_.positions, quad), q);
      const Vector3 n = (point(quad[2]) - point(quad[0])).cross(point(quad[3]) - point(quad[1]));
      if (j > turned && std::all_of(sides.begin(), sides.end(),
                                    [&](Index f) { return f == no_index || n.dot(mesh_.normal(f)) < -0.5 * n.norm(); }))
        j = turned;
      worst = std::min(worst, j);
    }
    return worst;
  }

  void put(Index v, const Place& place) {
    quads_.positions.row(v) = place.position.transpose();
    quads_.source[at(v)] = place.source;
    if (place.rail != no_index) rail_[at(v)] = place.rail;
  }

  /// Returns how far the vertex went, relative to its edges.
  double move(Index v) {
    if (fixed_[at(v)] || corners_.at(v).empty()) return 0;
    const Place here{point(v), quads_.source[at(v)], rail_[at(v)]};
    Vector3 mean = Vector3::Zero();
    double edge = 0;
    const auto count = static_cast<double>(corners_.at(v).size());
    for (const Index k : corners_.at(v)) {
      const Index q = k / 4;
      const int i = k % 4;
      mean += rectangle_corner(q, i) / count;
      edge += (point(quads_.quads(q, (i + 1) % 4)) - here.position).norm() / count;
    }
    if (!(edge > 0)) edge = 1e-300;
    const double before = least(v);
    double now = before;
    Place kept = here;
    const Place proposed = project(v, mean);
    put(v, proposed);
    const double after = least(v);
    if (after >= std::min(before, options_.accepted) && after > 0) {
      kept = proposed;
      now = after;
    } else if (after > before) {
      kept = proposed;
      now = after;
    }
    put(v, kept);
    if (now < options_.wanted) {
      // Look around in the tangent plane, coarse then fine.
      const Vector3 normal = mesh_.normal(kept.source.face);
      const Vector3 x = normal.unitOrthogonal(), y = normal.cross(x);
      for (const double radius : {0.4, 0.2, 0.1, 0.05}) {
        const Vector3 center = kept.position;
        Place best = kept;
        for (int k = 0; k < 8; ++k) {
          const double angle = k * 0.78539816339744831;
          const Place trial =
              project(v, center + radius * edge * (elementary::cos(angle) * x + elementary::sin(angle) * y));
          put(v, trial);
          if (const double j = least(v); j > now + 1e-6) {
            now = j;
            best = trial;
          }
          put(v, kept);
        }
        kept = best;
        put(v, kept);
      }
    }
    return (kept.position - here.position).norm() / edge;
  }

  /// Scaled Jacobian of a quad; little where it is turned over, however even it is.
  [[nodiscard]] double quality(Index q) const {
    constexpr double turned = 0.06;
    const double j = of_best(scaled_jacobian(quads_.positions, quads_.quads.row(q)), q);
    return j > turned && turned_over(mesh_, quads_, q) ? turned : j;
  }
  [[nodiscard]] std::pair<double, double> statistics() const {
    double worst = 1, sum = 0;
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      const double j = quality(q);
      worst = std::min(worst, j);
      sum += j;
    }
    return {worst, quads_.quad_count() > 0 ? sum / quads_.quad_count() : 0};
  }

  const TriangleMesh<double>& mesh_;
  const PolishOptions& options_;
  QuadMesh& quads_;
  const QuadCorners corners_;
  std::optional<EdgeCurves> curves_;  // of the border and of what is kept
  std::vector<double> best_;          // scaled Jacobian that a quad can have; empty: 1
  std::vector<Index> rail_;
  std::vector<char> fixed_;
  std::vector<char> open_;  // a flag a vertex: something beside it moved since it was last tried
};

}  // namespace detail

QUADRIG_INLINE Status PolishOptions::validate() const {
  const auto bad = [](std::string field, std::string remedy) {
    return Error{ErrorCode::bad_option, "out of range", "polish." + std::move(field), std::move(remedy)};
  };
  if (rounds < 0) return bad("rounds", "give 0 or more");
  for (const auto& [value, field] : {std::pair{accepted, "accepted"}, {freed, "freed"}, {wanted, "wanted"}})
    if (!(value >= -1 && value <= 1)) return bad(field, "give a scaled Jacobian, -1 to 1");
  return {};
}

QUADRIG_INLINE PolishedQuads polish(const TriangleMesh<double>& mesh, const PolishOptions& options, QuadMesh quads,
                                    Context& context, const EdgeMarks& kept, std::span<const char> held) {
  PolishedQuads polished{std::move(quads), {}};
  polished.report = detail::Polisher(mesh, options, kept, held, polished.mesh).run(context);
  return polished;
}

}  // namespace quadrig
