// Curves that an artist draws: laid onto a surface, as edges that quads keep or as a pull on their directions.
#pragma once

#include <map>

#include "quadrig/closest.hpp"
#include "quadrig/pipeline/features.hpp"
#include "quadrig/pipeline/piece.hpp"

namespace quadrig::detail {

/// Points along a guide, `step` apart at most, its corners among them.
[[nodiscard]] inline std::vector<Vector3> along_guide(const Guide& guide, double step) {
  constexpr std::size_t most = 100'000;
  std::vector<Vector3> points;
  const std::size_t n = guide.points.size(), last = guide.closed ? n : n - 1;
  for (std::size_t k = 0; k < last && points.size() < most; ++k) {
    const Vector3 &a = guide.points[k], &b = guide.points[(k + 1) % n];
    const auto parts = static_cast<int>(std::clamp((b - a).norm() / step, 1.0, 1e4));
    for (int i = 0; i < parts; ++i) points.push_back(a + (b - a) * (static_cast<double>(i) / parts));
  }
  points.push_back(guide.closed ? guide.points.front() : guide.points.back());
  return points;
}

[[nodiscard]] inline double mean_edge(const TriangleMesh<double>& mesh) {
  double sum = 0;
  for (Index h = 0; h < mesh.halfedge_count(); ++h) sum += mesh.edge_vector(h).norm();
  return mesh.halfedge_count() > 0 ? sum / mesh.halfedge_count() : 1;
}

/// A guide's way over a surface: through the edges that it crosses and the vertices that it meets.
class LaidGuide {
 public:
  struct Step {
    Index vertex = no_index;    ///< of the mesh; or
    Index halfedge = no_index;  ///< the lower of an edge that is crossed,
    double share = 0;           ///< so far along it
    friend bool operator==(const Step& a, const Step& b) { return a.vertex == b.vertex && a.halfedge == b.halfedge; }
  };

  /// \param far points farther from the surface than this are none of its
  LaidGuide(const TriangleMesh<double>& mesh, const ClosestPoint& closest, const std::vector<Vector3>& points,
            double far)
      : mesh_(mesh), closest_(closest), far_(far) {
    std::optional<SurfaceHit> before;
    for (const Vector3& p : points) {
      const std::optional<SurfaceHit> here = hit(p);
      if (before && here)
        walk(*before, *here, 0);
      else
        part();
      before = here;
    }
    part();
  }
  /// Each connected part of the way.
  [[nodiscard]] const std::vector<std::vector<Step>>& parts() const { return parts_; }

 private:
  [[nodiscard]] std::optional<SurfaceHit> hit(const Vector3& p) const {
    ClosestFilter filter;
    filter.maximum_distance = far_;
    const SurfaceHit found = closest_.closest(p, filter);
    return found.found() ? std::optional(found) : std::nullopt;
  }
  void part() {
    if (way_.size() > 1) parts_.push_back(std::move(way_));
    way_.clear();
  }
  void add(const Step& step) {
    if (!way_.empty() && way_.back() == step) return;
    if (way_.size() > 1 && way_[way_.size() - 2] == step) {  // there and back
      way_.pop_back();
      return;
    }
    way_.push_back(step);
  }

  /// From one point to another that lies near, halved until their faces meet.
  void walk(const SurfaceHit& from, const SurfaceHit& to, int depth) {
    if (from.face == to.face) return;
    for (const Index h : mesh_.halfedges_of(from.face))
      if (const Index g = mesh_.twin(h); g != no_index && g / 3 == to.face) return cross(h, from, to);
    constexpr int deepest = 12;
    if (depth < deepest)
      if (const auto middle = hit((from.position + to.position) / 2)) {
        walk(from, *middle, depth + 1);
        walk(*middle, to, depth + 1);
        return;
      }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        if (mesh_.faces()(from.face, i) == mesh_.faces()(to.face, j))
          return add({mesh_.faces()(from.face, i), no_index, 0});
    part();
  }
  void cross(Index h, const SurfaceHit& from, const SurfaceHit& to) {
    const Vector3 a = mesh_.position(mesh_.origin(h)), along = mesh_.edge_vector(h);
    const double length = along.squaredNorm();
    if (!(length > 0)) return;
    const auto off = [&](const Vector3& p) { return ((p - a) - along * ((p - a).dot(along) / length)).norm(); };
    const double here = off(from.position), there = off(to.position), all = here + there;
    const Vector3 p = all > 0 ? Vector3(from.position + (to.position - from.position) * (here / all)) : from.position;
    const double share = (p - a).dot(along) / length;
    constexpr double needle = 0.12;  // nearer to an end than that the way goes through the end
    if (share < needle) return add({mesh_.origin(h), no_index, 0});
    if (share > 1 - needle) return add({mesh_.target(h), no_index, 0});
    const Index g = mesh_.twin(h), low = std::min(h, g);
    add({no_index, low, low == h ? share : 1 - share});
  }

  const TriangleMesh<double>& mesh_;
  const ClosestPoint& closest_;
  const double far_;
  std::vector<Step> way_;
  std::vector<std::vector<Step>> parts_;
};

/// Cuts the piece along a guide and marks the cut as edges to keep.
inline void keep_guide(Piece& piece, const std::vector<Vector3>& points, double far) {
  const TriangleMesh<double>& mesh = piece.asset.mesh;
  const LaidGuide laid(mesh, ClosestPoint(mesh), points, far);
  std::map<Index, double> cuts;
  for (const auto& way : laid.parts())
    for (const LaidGuide::Step& step : way)
      if (step.halfedge != no_index) cuts.emplace(step.halfedge, step.share);
  std::vector<char> marked(at(mesh.halfedge_count()), 0);
  for (const auto& [h, share] : cuts) marked[at(h)] = 1;
  Refinement finer = split_edges(mesh, marked, [&](Index h) { return cuts.at(h); });
  // split_edges numbers the cuts in the order of their half-edges.
  std::map<Index, Index> number;
  Index next = mesh.vertex_count();
  for (const auto& [h, share] : cuts) number.emplace(h, next++);
  std::map<std::pair<Index, Index>, Index> edge;
  for (Index h = 0; h < finer.mesh.halfedge_count(); ++h)
    edge.emplace(std::pair{finer.mesh.origin(h), finer.mesh.target(h)}, h);
  EdgeMarks kept = carried_marks(mesh, piece.kept, finer), own(at(finer.mesh.halfedge_count()), 0);
  bool any = false;
  for (const auto& way : laid.parts()) {
    const auto vertex = [&](const LaidGuide::Step& step) {
      return step.vertex != no_index ? step.vertex : number.at(step.halfedge);
    };
    for (std::size_t k = 0; k + 1 < way.size(); ++k)
      for (const auto& [a, b] : {std::pair{vertex(way[k]), vertex(way[k + 1])}, {vertex(way[k + 1]), vertex(way[k])}})
        if (const auto found = edge.find({a, b}); found != edge.end() && finer.mesh.twin(found->second) != no_index)
          own[at(found->second)] = 1, any = true;
  }
  replace_mesh(piece, std::move(finer));
  if (any) piece.kept = joined_marks(std::move(own), kept);
}

/// The guides of a body that is mirrored, on the plane's side alone: each and its mirror image.
[[nodiscard]] inline std::vector<Guide> guides_of(const std::vector<Guide>& guides, const MirrorPlane* plane) {
  std::vector<Guide> all = guides;
  if (!plane) return all;
  for (const Guide& guide : guides) {
    Guide image = guide;
    for (Vector3& p : image.points) p = plane->mirrored(p);
    all.push_back(std::move(image));
  }
  return all;
}

/// How far from a surface a guide may be drawn, of its diagonal.
inline constexpr double guide_reach = 0.03;

/// Hard guides as edges to keep. \param plane of a half: what lies across it is left out
inline void keep_guides(Piece& piece, const std::vector<Guide>& guides, const MirrorPlane* plane) {
  if (guides.empty()) return;
  constexpr double fine = 0.25;
  const double step = fine * mean_edge(piece.asset.mesh), far = guide_reach * piece.asset.mesh.diagonal();
  for (const Guide& guide : guides_of(guides, plane)) {
    if (guide.width > 0) continue;
    std::vector<Vector3> points = along_guide(guide, step);
    if (plane) {
      // What crosses the plane is cut there: a part ends where a point is far from everything.
      for (Vector3& p : points)
        if (plane->side(p) < -plane->tolerance) p = Vector3::Constant(std::numeric_limits<double>::max() / 1e10);
    }
    keep_guide(piece, points, far);
  }
}

/// Soft guides as directions of the faces within their width, weaker farther off.
inline void pull_along_guides(const TriangleMesh<double>& mesh, const std::vector<Guide>& guides,
                              const MirrorPlane* plane, std::vector<FaceDirection>& directions) {
  if (std::ranges::none_of(guides, [](const Guide& guide) { return guide.width > 0; })) return;
  const ClosestPoint closest(mesh);
  std::map<Index, std::pair<double, FaceDirection>> nearest;
  ClosestFilter filter;
  filter.maximum_distance = guide_reach * mesh.diagonal();
  for (const Guide& guide : guides_of(guides, plane)) {
    if (!(guide.width > 0)) continue;
    const std::vector<Vector3> points = along_guide(guide, std::max(mean_edge(mesh) / 2, guide.width / 8));
    for (std::size_t k = 0; k < points.size(); ++k) {
      const SurfaceHit hit = closest.closest(points[k], filter);
      if (!hit.found()) continue;
      const Vector3 along = points[std::min(k + 1, points.size() - 1)] - points[k > 0 ? k - 1 : 0];
      std::vector<Index> open{hit.face};
      std::map<Index, char> seen{{hit.face, 1}};
      for (std::size_t i = 0; i < open.size(); ++i) {
        const double d = (position(mesh, SurfacePoint{open[i], Vector3::Constant(1.0 / 3)}) - hit.position).norm();
        if (d > guide.width && i > 0) continue;
        const double weight = guide.weight * std::max(0.05, 1 - d / guide.width);
        auto [place, is_new] = nearest.try_emplace(open[i], d, FaceDirection{open[i], along, weight});
        if (!is_new && d < place->second.first) place->second = {d, {open[i], along, weight}};
        for (const Index h : mesh.halfedges_of(open[i]))
          if (const Index g = mesh.twin(h); g != no_index && seen.try_emplace(g / 3, 1).second) open.push_back(g / 3);
      }
    }
  }
  for (const auto& [face, found] : nearest) directions.push_back(found.second);
}

}  // namespace quadrig::detail
