// Vertices onto seams.
#include "seams.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace quadrig::gltf {
namespace {

/// Place on the half-edge nearest to p.
SurfaceHit on_halfedge(const TriangleMesh<double>& mesh, Index h, const Vector3& p) {
  const Vector3 from = mesh.position(mesh.origin(h)), along = mesh.position(mesh.target(h)) - from;
  const double length = along.squaredNorm(), t = length > 0 ? std::clamp(along.dot(p - from) / length, 0.0, 1.0) : 0.0;
  SurfaceHit hit;
  hit.face = h / 3;
  hit.barycentric = Vector3::Zero();
  hit.barycentric[h % 3] = 1 - t;
  hit.barycentric[(h % 3 + 1) % 3] = t;
  hit.position = from + t * along;
  hit.squared_distance = (hit.position - p).squaredNorm();
  return hit;
}

class Snapper {
  // A quad of scaled Jacobian 0 costs as much as this squared distance from its region, in quads' areas.
  static constexpr double shape_weight = 0.07;
  static constexpr double worth_while = 3e-5;  // of the same
  static constexpr int sweeps = 4, rings_that_give_way = 1;

 public:
  Snapper(const TriangleMesh<double>& mesh, Regions& regions, double least, const std::vector<char>& held,
          QuadMesh& quads)
      : mesh_(mesh),
        regions_(regions),
        least_(least),
        held_(held),
        quads_(quads),
        corners_(quads),
        reached_in_(at(mesh.face_count()), 0) {
    std::vector<Index> meeting(at(mesh.vertex_count()), 0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (regions.is_seam(h)) ++meeting[at(mesh.origin(h))];
    for (std::size_t v = 0; v < meeting.size(); ++v) branch_.push_back(meeting[v] > 0 && meeting[v] != 2);
  }

  SeamFigures run(const Context& context) {
    const auto cancelled = [&](Index v) { return v % 256 == 0 && context.cancelled(); };
    const auto n = at(quads_.quad_count());
    values_.resize(n);
    misfit_.assign(n, 0);
    stale_.assign(n, 1);
    unrest_.assign(at(quads_.vertex_count()), 1);
    area_.resize(n);
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      Vector3 p[4];
      for (int i = 0; i < 4; ++i) p[i] = point(quads_.quads(q, i));
      area_[at(q)] = (p[2] - p[0]).cross(p[3] - p[1]).norm() / 2;
    }
    find_sides();
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      bool moved = false;
      for (Index v = 0; v < quads_.vertex_count() && !cancelled(v); ++v)
        if (sides_[at(v)] > 0 && unrest_[at(v)]) moved = snap(v) || moved;
      for (Index v = 0; v < quads_.vertex_count() && !cancelled(v); ++v)
        if (near_[at(v)] && std::exchange(unrest_[at(v)], char{0})) moved = give_way(v) || moved;
      find_sides();  // a quad that was moved may lie in another region now
      if (!moved || context.cancelled()) break;
    }
    SeamFigures figures;
    for (const auto& [a, b] : edges_) {
      ++figures.edges;
      figures.on_seams += on_seam(a) && on_seam(b);
    }
    for (const Index sides : sides_) figures.placed.push_back(sides > 0);
    return figures;
  }

 private:
  [[nodiscard]] Vector3 point(Index v) const { return quads_.positions.row(v).transpose(); }

  /// Edges between quads of different regions, and how many of them each vertex has; border vertices have none.
  void find_sides() {
    struct Side {
      Index low, high, quad;
      int corner;
    };
    std::vector<Side> all;
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      if (stale_[at(q)]) evaluate(q);
      for (int i = 0; i < 4; ++i) {
        const auto [low, high] = std::minmax(quads_.quads(q, i), quads_.quads(q, (i + 1) % 4));
        all.push_back({low, high, q, i});
      }
    }
    std::sort(all.begin(), all.end(), [](const Side& a, const Side& b) {
      return std::array{a.low, a.high, a.quad} < std::array{b.low, b.high, b.quad};
    });
    edges_.clear();
    sides_.assign(at(quads_.vertex_count()), 0);
    border_.assign(at(quads_.vertex_count()), 0);
    for (std::size_t k = 0; k < all.size(); ++k) {
      const Side& a = all[k];
      if (k + 1 == all.size() || all[k + 1].low != a.low || all[k + 1].high != a.high) {
        border_[at(a.low)] = border_[at(a.high)] = 1;
        continue;
      }
      const Side& b = all[++k];
      const auto value = [&](const Side& side, Index v) -> const Eigen::VectorXd& {
        int i = 0;
        while (quads_.quads(side.quad, i) != v) ++i;
        return values_[at(side.quad)].corners[static_cast<std::size_t>(i)];
      };
      if (values_[at(a.quad)].primitive == values_[at(b.quad)].primitive &&
          regions_.alike(value(a, a.low), value(b, a.low)) && regions_.alike(value(a, a.high), value(b, a.high)))
        continue;
      edges_.push_back({a.low, a.high});
      ++sides_[at(a.low)];
      ++sides_[at(a.high)];
    }
    near_.assign(at(quads_.vertex_count()), 0);
    beside_.assign(at(quads_.quad_count()), 0);
    std::vector<Index> ring;
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      if (border_[at(v)]) sides_[at(v)] = 0;
      if (sides_[at(v)] == 0) continue;
      near_[at(v)] = 1;
      ring.push_back(v);
    }
    std::size_t first = 0;
    for (int rings = 0; rings < rings_that_give_way; ++rings) {
      const std::size_t last = ring.size();
      for (; first < last; ++first)
        for (const Index k : corners_.at(ring[first]))
          for (int i = 0; i < 4; ++i)
            if (const Index w = quads_.quads(k / 4, i); !near_[at(w)] && !border_[at(w)]) {
              near_[at(w)] = 1;
              ring.push_back(w);
            }
    }
    for (const Index v : ring)
      for (const Index k : corners_.at(v)) beside_[at(k / 4)] = 1;
  }

  void evaluate(Index q) {
    values_[at(q)] = regions_.of_quad(quads_, q, misfit_[at(q)]);
    stale_[at(q)] = 0;
  }

  /// What the shapes of the quads around a vertex cost.
  [[nodiscard]] double shape_cost(Index v, double& worst) const {
    double sum = 0;
    worst = 1;
    for (const Index k : corners_.at(v)) {
      const double j = scaled_jacobian(quads_.positions, quads_.quads.row(k / 4));
      worst = std::min(worst, j);
      sum += shape_weight * (1 - j);
    }
    return sum;
  }
  /// What those of them cost that lie beside another region, by their distance from their own.
  [[nodiscard]] double fit_cost(Index v) const {
    double sum = 0;
    for (const Index k : corners_.at(v))
      if (beside_[at(k / 4)]) sum += misfit_[at(k / 4)] / area_[at(k / 4)];
    return sum;
  }
  /// Moves the vertex where that costs less and no quad becomes worse than `least_` or than it was.
  bool put(Index v, const SurfaceHit& place) {
    if (held_[at(v)]) return false;
    double was = 0, is = 0;
    const double before = shape_cost(v, was) + fit_cost(v) - worth_while;
    const Vector3 position = point(v);
    const SurfacePoint source = quads_.source[at(v)];
    quads_.positions.row(v) = place.position.transpose();
    quads_.source[at(v)] = {place.face, place.barycentric};
    const double shape = shape_cost(v, is);
    if (is >= std::min(was, least_) && shape < before) {
      kept_.clear();
      for (const Index k : corners_.at(v)) {
        const Index q = k / 4;
        if (beside_[at(q)]) {
          kept_.emplace_back(q, std::pair(std::move(values_[at(q)]), misfit_[at(q)]));
          evaluate(q);
        }
      }
      if (shape + fit_cost(v) < before) {
        for (const Index k : corners_.at(v)) {
          stale_[at(k / 4)] = beside_[at(k / 4)] ? 0 : 1;
          for (int i = 0; i < 4; ++i) unrest_[at(quads_.quads(k / 4, i))] = 1;
        }
        return true;
      }
      for (auto& [q, old] : kept_) {
        values_[at(q)] = std::move(old.first);
        misfit_[at(q)] = old.second;
      }
    }
    quads_.positions.row(v) = position.transpose();
    quads_.source[at(v)] = source;
    return false;
  }

  [[nodiscard]] double reach(Index v) const {
    double sum = 0, count = 0;
    for (const Index k : corners_.at(v))
      for (int i = 0; i < 4; ++i) {
        const Index a = quads_.quads(k / 4, i), b = quads_.quads(k / 4, (i + 1) % 4);
        if (a != v && b != v) continue;
        sum += (point(a) - point(b)).norm();
        ++count;
      }
    return 0.75 * sum / count;
  }

  /// Of the faces around the vertex the place on a seam that is nearest to p, within the radius, and the nearest end or
  /// branch of one.
  void look_around(Index v, double radius, const Vector3& p, SurfaceHit& seam, SurfaceHit& branch) {
    const double squared = radius * radius;
    ++current_;
    open_.assign(1, quads_.source[at(v)].face);
    reached_in_[at(open_[0])] = current_;
    for (std::size_t k = 0; k < open_.size(); ++k)
      for (Index h = 3 * open_[k]; h < 3 * open_[k] + 3; ++h) {
        const SurfaceHit hit = on_halfedge(mesh_, h, p);
        if (regions_.is_seam(h) && hit.squared_distance < std::min(squared, seam.squared_distance)) seam = hit;
        if (branch_[at(mesh_.origin(h))]) {
          const double distance = (mesh_.position(mesh_.origin(h)) - p).squaredNorm();
          if (distance < std::min(squared, branch.squared_distance)) {
            branch.face = h / 3;
            branch.barycentric = Vector3::Unit(h % 3);
            branch.position = mesh_.position(mesh_.origin(h));
            branch.squared_distance = distance;
          }
        }
        const Index across = mesh_.twin(h);
        if (across == no_index || reached_in_[at(across / 3)] == current_ || hit.squared_distance > squared) continue;
        reached_in_[at(across / 3)] = current_;
        open_.push_back(across / 3);
      }
  }

  [[nodiscard]] bool on_seam(Index v) const {
    const SurfacePoint& s = quads_.source[at(v)];
    for (int i = 0; i < 3; ++i)
      if (s.barycentric[(i + 2) % 3] <= 1e-9 && regions_.is_seam(3 * s.face + i)) return true;
    return false;
  }

  bool snap(Index v) {
    SurfaceHit seam, branch;
    look_around(v, reach(v), point(v), seam, branch);
    if (sides_[at(v)] != 2 && branch.found()) {
      if (branch.squared_distance == 0) return false;
      if (put(v, branch)) return true;
    }
    return seam.found() && !on_seam(v) && put(v, seam);
  }

  /// Towards the mean of its neighbours; what lies on a seam slides along it or leaves it.
  bool give_way(Index v) {
    Vector3 mean = Vector3::Zero();
    double count = 0;
    for (const Index k : corners_.at(v))
      for (int i = 0; i < 4; ++i) {
        const Index a = quads_.quads(k / 4, i), b = quads_.quads(k / 4, (i + 1) % 4);
        if (a != v && b != v) continue;
        mean += point(a == v ? b : a);
        ++count;
      }
    mean /= count;
    for (const double step : {1.0, 0.5}) {
      const Vector3 goal = point(v) + step * (mean - point(v));
      if (on_seam(v)) {
        SurfaceHit seam, branch;
        look_around(v, reach(v), goal, seam, branch);
        if (seam.found() && put(v, seam)) return true;
      }
      if (put(v, walk_closest(mesh_, goal, quads_.source[at(v)]))) return true;
    }
    return false;
  }

  const TriangleMesh<double>& mesh_;
  Regions& regions_;
  double least_;
  const std::vector<char>& held_;
  QuadMesh& quads_;
  const QuadCorners corners_;
  std::vector<std::array<Index, 2>> edges_;
  std::vector<Index> sides_;                 // a vertex: edges between regions
  std::vector<Regions::QuadValues> values_;  // of each quad
  std::vector<double> misfit_, area_;        // of each quad; the area is that before all
  std::vector<char> stale_, beside_;         // of each quad: moved since, has a vertex between regions
  std::vector<std::pair<Index, std::pair<Regions::QuadValues, double>>> kept_;
  std::vector<char> border_, near_, branch_, unrest_;  // of each vertex; the last: something around it moved since
  std::vector<Index> open_;
  std::vector<std::uint32_t> reached_in_;  // a face: the last search that came to it
  std::uint32_t current_ = 0;
};

}  // namespace

SeamFigures snap_to_seams(const TriangleMesh<double>& mesh, Regions& regions, double least,
                          const std::vector<char>& held, QuadMesh& quads, const Context& context) {
  if (!regions.any_seam()) return {};
  return Snapper(mesh, regions, least, held, quads).run(context);
}

}  // namespace quadrig::gltf
