// Vertices onto seams.
#include "seams.hpp"

#include <algorithm>
#include <array>

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
 public:
  Snapper(const TriangleMesh<double>& mesh, Regions& regions, double least, QuadMesh& quads)
      : mesh_(mesh), regions_(regions), least_(least), quads_(quads), reached_in_(at(mesh.face_count()), 0) {
    starts_.assign(at(quads.vertex_count()) + 1, 0);
    for (Index q = 0; q < quads.quad_count(); ++q)
      for (int i = 0; i < 4; ++i) ++starts_[at(quads.quads(q, i)) + 1];
    for (std::size_t v = 1; v < starts_.size(); ++v) starts_[v] += starts_[v - 1];
    around_.resize(starts_.back());
    std::vector<std::size_t> next(starts_.begin(), starts_.end() - 1);
    for (Index q = 0; q < quads.quad_count(); ++q)
      for (int i = 0; i < 4; ++i) around_[next[at(quads.quads(q, i))]++] = q;
    std::vector<Index> meeting(at(mesh.vertex_count()), 0);
    for (Index h = 0; h < mesh.halfedge_count(); ++h)
      if (regions.is_seam(h)) ++meeting[at(mesh.origin(h))];
    for (std::size_t v = 0; v < meeting.size(); ++v) branch_.push_back(meeting[v] > 0 && meeting[v] != 2);
  }

  SeamFigures run() {
    find_sides();
    for (int sweep = 0; sweep < 3; ++sweep) {
      bool moved = false;
      for (Index v = 0; v < quads_.vertex_count(); ++v) moved = (sides_[at(v)] > 0 && snap(v)) || moved;
      if (!moved) break;
      for (Index v = 0; v < quads_.vertex_count(); ++v)
        if (beside_[at(v)]) give_way(v);
    }
    find_sides();  // a quad that was moved may lie in another region now
    SeamFigures figures;
    for (const auto& [a, b] : edges_) {
      ++figures.edges;
      figures.on_seams += on_seam(a) && on_seam(b);
    }
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
    std::vector<Regions::QuadValues> values;
    values.reserve(at(quads_.quad_count()));
    for (Index q = 0; q < quads_.quad_count(); ++q) {
      values.push_back(regions_.of_quad(quads_, q));
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
    beside_.assign(at(quads_.vertex_count()), 0);
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
        return values[at(side.quad)].corners[static_cast<std::size_t>(i)];
      };
      if (values[at(a.quad)].primitive == values[at(b.quad)].primitive &&
          regions_.alike(value(a, a.low), value(b, a.low)) && regions_.alike(value(a, a.high), value(b, a.high)))
        continue;
      edges_.push_back({a.low, a.high});
      ++sides_[at(a.low)];
      ++sides_[at(a.high)];
    }
    for (Index v = 0; v < quads_.vertex_count(); ++v) {
      if (border_[at(v)]) sides_[at(v)] = 0;
      if (sides_[at(v)] == 0) continue;
      for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
        for (int i = 0; i < 4; ++i) beside_[at(quads_.quads(around_[k], i))] = 1;
    }
    for (Index v = 0; v < quads_.vertex_count(); ++v)
      beside_[at(v)] = beside_[at(v)] && !sides_[at(v)] && !border_[at(v)];
  }

  [[nodiscard]] double worst_around(Index v) const {
    double worst = 1;
    for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
      worst = std::min(worst, scaled_jacobian(quads_.positions, quads_.quads.row(around_[k])));
    return worst;
  }
  bool put(Index v, const SurfaceHit& place, bool better) {
    const Vector3 before = point(v);
    const double was = worst_around(v);
    quads_.positions.row(v) = place.position.transpose();
    const double is = worst_around(v);
    if (better ? is > was : is >= std::min(was, least_)) {
      quads_.source[at(v)] = {place.face, place.barycentric};
      return true;
    }
    quads_.positions.row(v) = before.transpose();
    return false;
  }

  [[nodiscard]] double reach(Index v) const {
    double sum = 0, count = 0;
    for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
      for (int i = 0; i < 4; ++i) {
        const Index a = quads_.quads(around_[k], i), b = quads_.quads(around_[k], (i + 1) % 4);
        if (a != v && b != v) continue;
        sum += (point(a) - point(b)).norm();
        ++count;
      }
    return 0.75 * sum / count;
  }

  /// The nearest place on a seam within the radius, and the nearest end or branch of one.
  void look_around(Index v, double radius, SurfaceHit& seam, SurfaceHit& branch) {
    const Vector3 p = point(v);
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
    look_around(v, reach(v), seam, branch);
    if (sides_[at(v)] != 2 && branch.found()) {
      if (branch.squared_distance == 0) return false;
      if (put(v, branch, false)) return true;
    }
    return seam.found() && !on_seam(v) && put(v, seam, false);
  }

  /// Half-way to the mean of its neighbours, where that makes its worst quad better.
  void give_way(Index v) {
    Vector3 mean = Vector3::Zero();
    double count = 0;
    for (std::size_t k = starts_[at(v)]; k < starts_[at(v) + 1]; ++k)
      for (int i = 0; i < 4; ++i) {
        const Index a = quads_.quads(around_[k], i), b = quads_.quads(around_[k], (i + 1) % 4);
        if (a != v && b != v) continue;
        mean += point(a == v ? b : a);
        ++count;
      }
    static_cast<void>(put(v, walk_closest(mesh_, (point(v) + mean / count) / 2, quads_.source[at(v)]), true));
  }

  const TriangleMesh<double>& mesh_;
  Regions& regions_;
  double least_;
  QuadMesh& quads_;
  std::vector<std::size_t> starts_;
  std::vector<Index> around_;  // quads of each vertex
  std::vector<std::array<Index, 2>> edges_;
  std::vector<Index> sides_;  // a vertex: edges between regions
  std::vector<char> border_, beside_, branch_;
  std::vector<Index> open_;
  std::vector<std::uint32_t> reached_in_;  // a face: the last search that came to it
  std::uint32_t current_ = 0;
};

}  // namespace

SeamFigures snap_to_seams(const TriangleMesh<double>& mesh, Regions& regions, double least, QuadMesh& quads) {
  if (!regions.any_seam()) return {};
  return Snapper(mesh, regions, least, quads).run();
}

}  // namespace quadrig::gltf
