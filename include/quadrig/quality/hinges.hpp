// Closed rings of quads at the joints that bend them.
#pragma once

#include "quadrig/constraints/hinges.hpp"
#include "quadrig/quads.hpp"

namespace quadrig {

/// What a quad mesh has at one hinge.
struct HingeRings {
  Index bone = no_index;
  Index loops = 0;   ///< closed loops of edges round the limb through regular vertices, within the bend
  Index around = 0;  ///< quads around: of a loop, or as many as the curve of the hinge crosses
  Index poles = 0;   ///< inner vertices within the bend that have more or less than four edges
  double rows = 0;   ///< of quads that the bend is long
};

namespace detail {

/// The closed loops of edges that go straight on through vertices of four edges, none of them twice.
inline std::vector<std::vector<Index>> closed_edge_loops(const Quads& quads, const std::vector<Index>& twin,
                                                         const std::vector<char>& regular) {
  const auto corner = [&](Index h) { return quads(h / 4, h % 4); };
  const auto next = [](Index h) { return h % 4 == 3 ? h - 3 : h + 1; };
  std::vector<char> seen(twin.size(), 0), met(regular.size(), 0);
  std::vector<std::vector<Index>> loops;
  for (Index seed = 0; seed < static_cast<Index>(twin.size()); ++seed) {
    std::vector<Index> vertices;
    Index h = seed;
    while (!seen[at(h)] && twin[at(h)] != no_index && regular[at(corner(h))]) {
      seen[at(h)] = seen[at(twin[at(h)])] = 1;
      vertices.push_back(corner(h));
      const Index across = twin[at(next(h))];
      if (across == no_index) break;
      h = next(across);
    }
    bool simple = h == seed && vertices.size() > 2;
    for (const Index v : vertices) simple = simple && !met[at(v)]++;
    for (const Index v : vertices) met[at(v)] = 0;
    if (simple) loops.push_back(std::move(vertices));
  }
  return loops;
}

/// The quads as triangles about their middles, which are numbered after the vertices, with the weights there.
struct QuadFans {
  TriangleMesh<double> mesh;
  SkinWeights weights;
};
inline Expected<QuadFans> quad_fans(const QuadMesh& quads, const SkinWeights& weights) {
  const Index n = quads.vertex_count(), m = quads.quad_count();
  Points<double> positions(n + m, 3);
  positions.topRows(n) = quads.positions;
  Triangles faces(4 * m, 3);
  std::vector<Eigen::Triplet<double, Index>> entries;
  const auto add = [&](Index row, Index of, double share) {
    for (SkinWeights::InnerIterator it(weights, of); it; ++it)
      entries.emplace_back(row, static_cast<Index>(it.col()), share * it.value());
  };
  for (Index v = 0; v < n; ++v) add(v, v, 1);
  for (Index q = 0; q < m; ++q) {
    positions.row(n + q).setZero();
    for (int i = 0; i < 4; ++i) {
      const Index v = quads.quads(q, i);
      positions.row(n + q) += quads.positions.row(v) / 4;
      add(n + q, v, 0.25);
      faces.row(4 * q + i) << v, quads.quads(q, (i + 1) % 4), n + q;
    }
  }
  Expected<TriangleMesh<double>> mesh = TriangleMesh<double>::create(std::move(positions), std::move(faces));
  if (!mesh) return mesh.error();
  QuadFans fans{std::move(*mesh), SkinWeights(n + m, weights.cols())};
  fans.weights.setFromTriplets(entries.begin(), entries.end());
  return fans;
}

/// Counts loops and poles at hinges.
class HingeCounter {
 public:
  HingeCounter(const QuadMesh& quads, const TriangleMesh<double>& fans) : quads_(quads), fans_(fans) {
    std::vector<Index> valence(at(quads.vertex_count()), 0), twin(at(4 * quads.quad_count()), no_index);
    regular_.assign(valence.size(), 0);
    irregular_.assign(valence.size(), 0);
    for (Index h = 0; h < 4 * quads.quad_count(); ++h) {
      ++valence[at(quads.quads(h / 4, h % 4))];
      // The outer edge of each triangle is that of the quad.
      if (const Index g = fans.twin(3 * h); g != no_index) twin[at(h)] = g / 3;
    }
    for (Index v = 0; v < quads.vertex_count(); ++v) {
      const bool inside = fans.outgoing(v) != no_index && !fans.on_boundary(v);
      regular_[at(v)] = inside && valence[at(v)] == 4;
      irregular_[at(v)] = inside && valence[at(v)] != 4;
    }
    loops_ = closed_edge_loops(quads.quads, twin, regular_);
    place_.assign(at(fans.vertex_count()), nullptr);
  }

  [[nodiscard]] HingeRings operator()(const Hinge& hinge) {
    HingeRings rings{hinge.bone, 0, 0, 0, 0};
    constexpr double beyond = 1.75;  // bends: how far a loop may stray of which three quarters lie within
    const std::vector<BesideLoop> beside = vertices_beside(fans_, hinge.loop, beyond * hinge.bend);
    measure_along(hinge.loop);
    for (const BesideLoop& near : beside) {
      place_[at(near.vertex)] = &near;
      if (near.vertex < quads_.vertex_count() && std::abs(near.distance) <= hinge.bend)
        rings.poles += irregular_[at(near.vertex)];
    }
    for (const std::vector<Index>& loop : loops_)
      if (goes_round(loop, hinge.bend)) {
        ++rings.loops;
        const auto around = static_cast<Index>(loop.size());
        rings.around = rings.around == 0 ? around : std::min(rings.around, around);
      }
    if (rings.around == 0)
      for (const Index h : hinge.loop.crossed) rings.around += h % 3 == 0;  // an edge of a quad
    const double edge = rings.around > 0 ? hinge.length / rings.around : hinge.length;
    rings.rows = 2 * hinge.bend / edge;
    for (const BesideLoop& near : beside) place_[at(near.vertex)] = nullptr;
    return rings;
  }

 private:
  /// Length of the curve up to each crossing.
  void measure_along(const FaceLoop& loop) {
    along_.assign(1, 0.0);
    for (std::size_t k = 0; k < loop.crossed.size(); ++k)
      along_.push_back(along_.back() +
                       (crossing(fans_, loop, (k + 1) % loop.crossed.size()) - crossing(fans_, loop, k)).norm());
  }

  /// Whether a loop of edges goes once round, most of it within the bend.
  [[nodiscard]] bool goes_round(const std::vector<Index>& loop, double bend) const {
    const double length = along_.back();
    double turned = 0;
    std::size_t within = 0;
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const BesideLoop *here = place_[at(loop[k])], *there = place_[at(loop[(k + 1) % loop.size()])];
      if (!here || !there) return false;
      within += std::abs(here->distance) <= bend;
      const double step = along_[there->crossing] - along_[here->crossing];
      turned += step - length * std::round(step / length);
    }
    return 4 * within >= 3 * loop.size() && std::lround(std::abs(turned) / length) == 1;
  }

  const QuadMesh& quads_;
  const TriangleMesh<double>& fans_;
  std::vector<char> regular_, irregular_;
  std::vector<std::vector<Index>> loops_;
  std::vector<const BesideLoop*> place_;  // of each vertex beside the hinge at hand
  std::vector<double> along_;
};

}  // namespace detail

/// The rings of quads at every hinge of a skinned quad mesh (find_hinges), by bone; empty where the quads are no
/// manifold. \pre weights has a row a vertex and a column a bone
/// \cost O(b m) for b bones, and for each hinge O(n) and its neighbourhood
[[nodiscard]] inline std::vector<HingeRings> hinge_rings(const QuadMesh& quads, const Skeleton& skeleton,
                                                         const SkinWeights& weights) {
  std::vector<HingeRings> all;
  Expected<detail::QuadFans> fans = detail::quad_fans(quads, weights);
  if (!fans) return all;
  detail::HingeCounter count(quads, fans->mesh);
  for (const Hinge& hinge : find_hinges(fans->mesh, {skeleton, std::move(fans->weights), {}}))
    all.push_back(count(hinge));
  return all;
}

}  // namespace quadrig
