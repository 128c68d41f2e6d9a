#pragma once

#include <numeric>
#include <set>

#include "quadrig/closest.hpp"
#include "quadrig/pipeline/gaps.hpp"
#include "quadrig/quads/topology.hpp"

namespace quadrig::detail {

QUADRIG_INLINE std::optional<WithoutGaps> without_gaps(const Asset& asset, const RemeshOptions& options,
                                                       const Context& context) {
  constexpr double a_quad = 4;       // edges around
  constexpr Index quads_a_hole = 4;  // fewer have no room for the holes
  const bool exact = options.exact_borders || options.preset == FieldPreset::thesis || options.directions.terms;
  if (exact && !(options.fill_holes > 0)) return std::nullopt;
  const double edge = std::sqrt(asset.mesh.total_area() / options.quads);
  const GapOptions all{exact ? 0 : a_quad * edge, options.fill_holes, exact ? 0 : edge};
  std::optional<Bridged> bridged = bridge_gaps(asset.mesh, all, context);
  const auto stays = [&](const Bridged::Hole& hole) { return hole.length <= options.fill_holes; };
  if (bridged) {
    const auto cut = std::ranges::count_if(bridged->holes, std::not_fn(stays));
    if (quads_a_hole * cut > options.quads)
      bridged = bridge_gaps(asset.mesh, {0, options.fill_holes, all.notch}, context);
  }
  if (!bridged) return std::nullopt;

  WithoutGaps result{{std::move(bridged->mesh), asset.rig}, options, {}, {}, bridged->left_open};
  result.report.notches = bridged->notches;
  result.report.notch_share = bridged->notch_area / asset.mesh.total_area();
  for (const Bridged::Hole& hole : bridged->holes)
    if (stays(hole))
      ++result.report.holes_filled;
    else
      result.holes.push_back(hole);
  result.options.quads += static_cast<Index>(result.holes.size());
  // Values by face: those of a face beside it.
  const auto extend = [&](std::vector<double>& values) {
    if (values.size() != at(asset.mesh.face_count())) return;
    for (Index f = asset.mesh.face_count(); f < result.asset.mesh.face_count(); ++f) {
      double value = 1;
      for (const Index h : result.asset.mesh.halfedges_of(f))
        if (const Index g = result.asset.mesh.twin(h); g != no_index && g / 3 < f) value = values[at(g / 3)];
      values.push_back(value);
    }
  };
  extend(result.options.density_factors);
  if (result.options.sizing) extend(result.options.sizing->own_density);
  return result;
}

/// Holes in quads, one after the other.
class HoleCutter {
 public:
  HoleCutter(const TriangleMesh<double>& surface, UnfittedQuads& quads)
      : surface_(surface),
        unfitted_(quads),
        mesh_(quads.mesh),
        corners_(quads.mesh),
        taken_(at(quads.mesh.vertex_count()), 0),
        gone_(at(quads.mesh.quad_count()), 0),
        rings_(gone_) {
    Triangles halves(2 * mesh_.quad_count(), 3);
    for (Index q = 0; q < mesh_.quad_count(); ++q) {
      halves.row(2 * q) << mesh_.quads(q, 0), mesh_.quads(q, 1), mesh_.quads(q, 2);
      halves.row(2 * q + 1) << mesh_.quads(q, 0), mesh_.quads(q, 2), mesh_.quads(q, 3);
    }
    search_ = ClosestPoint(mesh_.positions, halves);
    for (Index q = 0; q < mesh_.quad_count(); ++q)
      for (int i = 0; i < 4; ++i)
        if (beside(q, i) == no_index) taken_[at(mesh_.quads(q, i))] = taken_[at(mesh_.quads(q, (i + 1) % 4))] = 1;
    for (std::size_t v = 0; v < taken_.size() && v < unfitted_.on_features.size(); ++v)
      taken_[v] = taken_[v] || unfitted_.on_features[v];
  }

  /// False where there is no room. No quads are renumbered before `finish`.
  bool cut(const Bridged::Hole& hole) {
    const SurfaceHit hit = search_.closest(hole.centre);
    if (!hit.found()) return false;
    const std::vector<Index> near = around(hit.face / 2, hole.centre);
    for (const Index q : near)
      if (is_free(q)) return leave_out(q, hole.length), true;
    for (const double worst : {even, 0.2})
      for (const Index q : near)
        if (!gone_[at(q)] && !rings_[at(q)] && ring(q, hole.length, worst)) return true;
    return false;
  }

  /// Takes the quads that were left out away, and adds the new ones to their components.
  void finish() {
    Quads left(mesh_.quad_count() + 3 * std::accumulate(rings_.begin(), rings_.end(), Index{0}) -
                   std::accumulate(gone_.begin(), gone_.end(), Index{0}),
               4);
    Index q = 0, row = 0;
    for (ComponentReport& part : unfitted_.report.components) {
      const Index first = row;
      bool changed = false;
      for (const Index end = q + part.quads; q < end; ++q) {
        changed = changed || gone_[at(q)] || rings_[at(q)];
        if (gone_[at(q)]) continue;
        if (!rings_[at(q)]) {
          left.row(row++) = mesh_.quads.row(q);
          continue;
        }
        const Index inner = inner_[at(q)];
        for (int i = 0; i < 4; ++i) {
          const int j = (i + 1) % 4;
          left.row(row++) << mesh_.quads(q, i), mesh_.quads(q, j), inner + j, inner + i;
        }
      }
      part.quads = row - first;
      if (changed) part.irregular = quad_topology(left.middleRows(first, row - first), mesh_.vertex_count()).irregular;
    }
    mesh_.quads = std::move(left);
    RemeshReport& report = unfitted_.report;
    report.quads = mesh_.quad_count();
    report.vertices = mesh_.vertex_count();
    report.irregular = 0;
    for (const ComponentReport& part : report.components) report.irregular += part.irregular;
  }

 private:
  static constexpr double even = 0.5;  // scaled Jacobian of what is beside a hole

  [[nodiscard]] Vector3 corner(Index q, int i) const { return mesh_.positions.row(mesh_.quads(q, i)).transpose(); }
  [[nodiscard]] Vector3 centre(Index q) const {
    return (corner(q, 0) + corner(q, 1) + corner(q, 2) + corner(q, 3)) / 4;
  }
  /// The quad across side i, or no_index.
  [[nodiscard]] Index beside(Index q, int i) const {
    const Index v = mesh_.quads(q, i), w = mesh_.quads(q, (i + 1) % 4);
    for (const Index c : corners_.at(w))
      if (mesh_.quads(c / 4, (c % 4 + 1) % 4) == v) return c / 4;
    return no_index;
  }
  /// A quad and those that share corners with it, the nearest first.
  [[nodiscard]] std::vector<Index> around(Index q, const Vector3& place) const {
    std::set<Index> all{q};
    for (int i = 0; i < 4; ++i)
      for (const Index c : corners_.at(mesh_.quads(q, i))) all.insert(c / 4);
    std::vector<Index> sorted(all.begin(), all.end());
    std::ranges::stable_sort(sorted, {}, [&](Index r) { return (centre(r) - place).squaredNorm(); });
    return sorted;
  }
  /// No corner is on a border, and no quad with such a corner has been changed.
  [[nodiscard]] bool is_free(Index q) const {
    for (int i = 0; i < 4; ++i) {
      if (taken_[at(mesh_.quads(q, i))]) return false;
      for (const Index c : corners_.at(mesh_.quads(q, i)))
        if (gone_[at(c / 4)] || rings_[at(c / 4)]) return false;
    }
    return true;
  }
  [[nodiscard]] double around_length(Index q) const {
    double length = 0;
    for (int i = 0; i < 4; ++i) length += (corner(q, (i + 1) % 4) - corner(q, i)).norm();
    return length;
  }
  void put(Index v, const Vector3& place) {
    const SurfaceHit hit = walk_closest(surface_, place, mesh_.source[at(v)]);
    mesh_.positions.row(v) = hit.position.transpose();
    mesh_.source[at(v)] = hit;
  }

  void leave_out(Index q, double length) {
    constexpr double least = 0.3;  // of the quad's own length
    gone_[at(q)] = 1;
    const Vector3 middle = centre(q);
    const double shrink = 1 - std::clamp(length / around_length(q), least, 1.0);
    std::array<Vector3, 4> before;
    std::array<SurfacePoint, 4> source;
    for (int i = 0; i < 4; ++i) {
      before[static_cast<std::size_t>(i)] = corner(q, i);
      source[static_cast<std::size_t>(i)] = mesh_.source[at(mesh_.quads(q, i))];
      taken_[at(mesh_.quads(q, i))] = 1;
      unfitted_.held[at(mesh_.quads(q, i))] = 1;
    }
    for (const double part : {1.0, 0.5, 0.25, 0.0}) {
      for (int i = 0; i < 4; ++i) {
        const Index v = mesh_.quads(q, i);
        const Vector3& from = before[static_cast<std::size_t>(i)];
        mesh_.positions.row(v) = from.transpose();
        mesh_.source[at(v)] = source[static_cast<std::size_t>(i)];
        if (part > 0) put(v, from + part * shrink * (middle - from));
      }
      double worst = 1;
      for (int i = 0; i < 4; ++i)
        for (const Index c : corners_.at(mesh_.quads(q, i)))
          if (c / 4 != q) worst = std::min(worst, scaled_jacobian(mesh_.positions, mesh_.quads.row(c / 4)));
      if (worst > even) return;
    }
  }

  /// Four quads about a hole in the middle of one. False where they would be skewed.
  [[nodiscard]] bool ring(Index q, double length, double bound) {
    constexpr double least = 0.15, most = 0.5;
    const double share = std::clamp(length / around_length(q), least, most);
    const Vector3 middle = centre(q);
    const Index first = mesh_.vertex_count();
    mesh_.positions.conservativeResize(first + 4, 3);
    for (int i = 0; i < 4; ++i) {
      mesh_.source.push_back(mesh_.source[at(mesh_.quads(q, i))]);
      put(first + i, middle + share * (corner(q, i) - middle));
    }
    double worst = 1;
    for (int i = 0; i < 4; ++i) {
      const int j = (i + 1) % 4;
      worst = std::min(worst,
                       scaled_jacobian(mesh_.positions, Eigen::Matrix<Index, 1, 4>(mesh_.quads(q, i), mesh_.quads(q, j),
                                                                                   first + j, first + i)));
    }
    if (!(worst > bound)) {
      mesh_.positions.conservativeResize(first, 3);
      mesh_.source.resize(at(first));
      return false;
    }
    rings_[at(q)] = 1;
    inner_.resize(gone_.size(), no_index);
    inner_[at(q)] = first;
    unfitted_.held.resize(at(first + 4), 1);
    unfitted_.on_features.resize(at(first + 4), 0);
    if (!unfitted_.twin.empty()) unfitted_.twin.resize(at(first + 4), no_index);
    return true;
  }

  const TriangleMesh<double>& surface_;
  UnfittedQuads& unfitted_;
  QuadMesh& mesh_;
  const QuadCorners corners_;  // of the quads before
  ClosestPoint search_;
  std::vector<char> taken_;   // a flag a vertex: on a border, or on one that was made
  std::vector<char> gone_;    // a flag a quad
  std::vector<char> rings_;   // likewise: four others are in its place
  std::vector<Index> inner_;  // of these, the first of the four vertices inside
};

QUADRIG_INLINE Index cut_holes(const TriangleMesh<double>& surface, std::vector<Bridged::Hole> holes,
                               UnfittedQuads& quads) {
  if (holes.empty()) return 0;
  std::ranges::stable_sort(holes, std::greater<>{}, &Bridged::Hole::length);
  HoleCutter cutter(surface, quads);
  Index made = 0;
  for (const Bridged::Hole& hole : holes) made += cutter.cut(hole);
  cutter.finish();
  quads.holes += made;
  return made;
}

/// What was done, for the warnings.
inline void warn_of_gaps(const GapReport& gaps, Index left_open, std::vector<Warning>& warnings) {
  const auto add = [&](Index count, const char* one, const char* many, const std::string& what) {
    if (count > 0) warnings.push_back({"border", std::to_string(count) + (count == 1 ? one : many) + what});
  };
  const std::string share = std::to_string(100 * gaps.notch_share).substr(0, 4);
  add(gaps.notches, " triangle bridges", " triangles bridge",
      " notches of a ragged border that are smaller than a quad: " + share + " % of the area");
  add(gaps.holes_cut, " hole is", " holes are",
      " smaller than a quad and not followed: one quad is left out for each; --fill-holes closes them");
  add(gaps.holes_closed, " hole is", " holes are",
      " smaller than a quad and closed: there was no room to leave it out");
  add(gaps.holes_filled, " hole", " holes", " closed");
  add(left_open, " hole", " holes", " small enough to close left open: no triangles between its corners close it");
}

QUADRIG_INLINE Expected<RemeshResult> remesh_without_gaps(const Asset& asset, const RemeshOptions& options,
                                                          const WithoutGaps& without, Context& context) {
  Expected<UnfittedQuads> quads = remesh_unfitted(without.asset, without.options, context);
  if (!quads) return quads.error();
  GapReport& gaps = quads->report.gaps;
  gaps = without.report;
  gaps.holes_cut = cut_holes(without.asset.mesh, without.holes, *quads);
  gaps.holes_closed = static_cast<Index>(without.holes.size()) - gaps.holes_cut;
  warn_of_gaps(gaps, without.left_open, quads->report.warnings);
  RemeshOptions wanted = without.options;
  wanted.quads = options.quads;
  Expected<RemeshResult> result = fit_and_skin(without.asset, wanted, std::move(*quads), context);
  if (!result) return result;

  // Vertices on what bridges a gap lie nearest to a face that the asset has.
  const Index before = asset.mesh.face_count();
  std::optional<ClosestPoint> search;
  for (Index v = 0; v < result->mesh.vertex_count(); ++v) {
    SurfacePoint& point = result->mesh.source[at(v)];
    if (point.face < before) continue;
    if (!search) search.emplace(asset.mesh);
    point = search->closest(result->mesh.positions.row(v).transpose());
  }
  const Components components = face_components(without.asset.mesh);
  for (Index f = before; f < without.asset.mesh.face_count(); ++f)
    --result->report.components[at(components.of_face[at(f)])].faces;
  return result;
}

}  // namespace quadrig::detail
