// Loops that the quads of a map close along: the translation once round has no component across them.
#pragma once

#include "quadrig/field/loops.hpp"
#include "quadrig/seamless/poisson.hpp"

namespace quadrig {

namespace detail {

/// z of a face from z of the face before, composed along a loop: z' = i^turn z + Σ.
inline void cross_cut(const CutGraph& cut, Index h, int& turn, LinearExpression<Gaussian>& translation) {
  const int r = cut.rotation[at(h)];
  turn += r;
  for (auto& term : translation) term.coefficient = rotated(term.coefficient, r);
  if (const Index b = cut.branch[at(h)]; b != no_index)
    accumulate(translation,
               LinearExpression<Gaussian>{{b, cut.forward[at(h)] ? Gaussian{1, 0} : -rotated(Gaussian{1, 0}, r)}},
               Gaussian{1, 0});
}

}  // namespace detail

/// What a map of these charts owes a loop; none where its charts turn once round it, or where the target leads across
/// it rather than along.
/// \cost O(crossings · cuts crossed)
[[nodiscard]] inline std::optional<LoopDemand> loop_demand(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                           const TargetEdges& target, const FaceLoop& loop) {
  using detail::at;
  const std::size_t n = loop.crossed.size();
  int turn = 0;
  LoopDemand demand;
  Complex way = 0;  // in the chart of the first face
  for (std::size_t k = 0; k < n; ++k) {
    const Index out = loop.crossed[k], in = mesh.twin(loop.crossed[(k + n - 1) % n]);
    // Between the middles of two edges of a face.
    const Complex step =
        mesh.next(in) == out ? (target[at(in)] + target[at(out)]) / 2.0 : -(target[at(in)] + target[at(out)]) / 2.0;
    way += rotated(step, -turn & 3);
    detail::cross_cut(cut, out, turn, demand.translation);
  }
  if ((turn & 3) != 0) return std::nullopt;
  const double u = std::abs(way.real()), v = std::abs(way.imag());
  // Maps follow ways that climb by a tenth; one that climbed by more than a half had flips all along.
  constexpr double steep = 0.25;
  if (!(std::min(u, v) < steep * std::max(u, v))) return std::nullopt;
  demand.component = u >= v ? 1 : 0;
  return demand;
}

/// The translation of a map once round a loop, in the chart of its first face. \pre charts do not turn along it
[[nodiscard]] inline Complex loop_translation(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                              const std::vector<Complex>& z, const FaceLoop& loop) {
  using detail::at;
  Complex sum = 0;
  for (const Index h : loop.crossed) {
    const int r = cut.rotation[at(h)];
    sum = rotated(sum, r) + z[at(mesh.next(mesh.twin(h)))] - rotated(z[at(h)], r);
  }
  return sum;
}

/// Whether a loop leads past corners of some faces. \param corners marks of these, a vertex
[[nodiscard]] inline bool passes(const TriangleMesh<double>& mesh, const FaceLoop& loop,
                                 std::span<const char> corners) {
  return std::ranges::any_of(loop.crossed, [&](Index h) {
    return corners[detail::at(mesh.origin(h))] || corners[detail::at(mesh.target(h))];
  });
}
/// A mark a vertex: whether it is a corner of one of the faces.
[[nodiscard]] inline std::vector<char> corners_of(const TriangleMesh<double>& mesh, std::span<const Index> faces) {
  std::vector<char> corners(detail::at(mesh.vertex_count()), 0);
  for (const Index f : faces)
    for (int i = 0; i < 3; ++i) corners[detail::at(mesh.faces()(f, i))] = 1;
  return corners;
}

namespace detail {

/// The loops that a map has to close along.
struct DemandedLoops {
  std::vector<Index> number;  ///< of each demand: which of the loops
  std::vector<LoopDemand> demands;

  void add(Index loop, LoopDemand demand) {
    number.push_back(loop);
    demands.push_back(std::move(demand));
  }
  /// Whether one leads past these faces: other sizes mend no defects there.
  [[nodiscard]] bool in_trouble(const TriangleMesh<double>& mesh, const std::vector<FaceLoop>& loops,
                                std::span<const Index> trouble) const {
    if (number.empty()) return false;
    const std::vector<char> corners = corners_of(mesh, trouble);
    return std::ranges::any_of(number, [&](Index k) { return passes(mesh, loops[at(k)], corners); });
  }
  /// Demands no longer what leads past these faces. Returns whether there was any.
  /// \param closed of all loops, on return 0 of those
  [[nodiscard]] bool release(const TriangleMesh<double>& mesh, const std::vector<FaceLoop>& loops,
                             std::span<const Index> trouble, std::vector<char>& closed) {
    const std::vector<char> corners = corners_of(mesh, trouble);
    DemandedLoops left;
    for (std::size_t k = 0; k < number.size(); ++k)
      if (passes(mesh, loops[at(number[k])], corners))
        closed[at(number[k])] = 0;
      else
        left.add(number[k], std::move(demands[k]));
    const bool any = left.number.size() < number.size();
    *this = std::move(left);
    return any;
  }
};

}  // namespace detail

}  // namespace quadrig
