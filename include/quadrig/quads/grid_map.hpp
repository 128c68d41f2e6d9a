// From integers on the coarse map to the fine map that takes them: exact back-substitution, and fixed point.
#pragma once

#include "quadrig/quads/extract.hpp"
#include "quadrig/quantize.hpp"

namespace quadrig {

/// The value that the quantization gives to every integer variable of the fine map.
template <class K>
struct IntegerSolution {
  using R = RingOf<K>;
  std::vector<K> unknown;                ///< per unknown of the map; the free ones are zero
  std::vector<Gaussian> branch;          ///< translation of each branch of the cut
  std::vector<std::array<bool, 2>> set;  ///< per vertex: whether U, V (in the vertex's own sector) are integers
  std::vector<Gaussian> vertex;          ///< their values, where set
};

/// \fails stage_failed where the integers contradict the seamless constraints, or leave one undetermined: an error of
///   this library that is reported, not hidden.
template <class K>
[[nodiscard]] Expected<IntegerSolution<K>> substitute_integers(const CutGraph& cut, const MapUnknowns<K>& unknowns,
                                                               const CoarseMap& map, const Quantization& integers) {
  using detail::at;
  using Unknowns = MapUnknowns<K>;
  using R = RingOf<K>;
  const Error contradiction{
      ErrorCode::stage_failed, "the integers contradict the seamless constraints", "quantization", {}};
  Elimination<R> elimination = unknowns.elimination();
  for (Index h = 0; h < map.halfedge_count(); ++h) {
    if (map.twin[at(h)] != no_index && map.twin[at(h)] < h) continue;
    for (int c = 0; c < Unknowns::components; ++c) {
      auto row = unknowns.project(map.expression[at(h)], c);
      R value;
      if constexpr (Unknowns::components == 1)
        value = -integers.edge[at(h)];
      else
        value = c == 0 ? -integers.edge[at(h)].re : -integers.edge[at(h)].im;
      if (!ring_zero(value)) accumulate(row, LinearExpression<R>{{unknowns.constant(), value}}, one_of(value));
      if (!elimination.add(row)) return contradiction;
    }
  }
  // Variables beyond `constant` are numbered after it; a resolved expression is one constant or still free.
  const auto constant_value = [&](Index variable) -> std::optional<R> {
    const auto e = elimination.resolved(LinearExpression<R>{{variable, one_of(R{})}});
    if (e.empty()) return R{};
    if (e.size() == 1 && e[0].variable == unknowns.constant()) return e[0].coefficient;
    return std::nullopt;
  };
  IntegerSolution<K> solution;
  solution.unknown.assign(at(unknowns.count()), K{});
  for (Index v = 0; v < unknowns.elimination().variable_count(); ++v) {
    const Index u = unknowns.unknown_of(v);
    if (u == no_index || !unknowns.integer()[at(u)]) continue;
    const std::optional<R> value = constant_value(v);
    if (!value)
      return Error{ErrorCode::stage_failed, "the integers leave a cone or a handle undetermined", "quantization", {}};
    solution.unknown[at(u)] = to_field(*value);
  }
  const Index n = unknowns.vertex_count();
  const auto point = [&](Index variable, std::array<bool, 2>& set) {
    Gaussian z;
    if constexpr (Unknowns::components == 1) {
      const std::optional<Gaussian> value = constant_value(variable);
      set = {value.has_value(), value.has_value()};
      if (value) z = *value;
    } else {
      const auto u = constant_value(2 * variable), v = constant_value(2 * variable + 1);
      set = {u.has_value(), v.has_value()};
      z = {u.value_or(0), v.value_or(0)};
    }
    return z;
  };
  std::array<bool, 2> known{};
  solution.branch.resize(at(cut.branch_count));
  for (Index b = 0; b < cut.branch_count; ++b) {
    solution.branch[at(b)] = point(n + b, known);
    if (!known[0] || !known[1])
      return Error{ErrorCode::stage_failed, "the integers leave a translation undetermined", "quantization", {}};
  }
  solution.set.assign(at(n), {false, false});
  solution.vertex.assign(at(n), Gaussian{});
  // Only variables of integer kind may be snapped: a free coarse vertex is fixed by no constraint of the fine map.
  for (Index v = 0; v < n; ++v) {
    std::array<bool, 2> wanted{};
    for (int c = 0; c < Unknowns::components; ++c)
      wanted[static_cast<std::size_t>(c)] =
          unknowns.elimination().kind(Unknowns::components * v + c) == Elimination<R>::Kind::integer;
    if constexpr (Unknowns::components == 1) wanted[1] = wanted[0];
    if (!wanted[0] && !wanted[1]) continue;
    solution.vertex[at(v)] = point(v, known);
    for (std::size_t c = 0; c < 2; ++c) {
      if (wanted[c] && !known[c])
        return Error{ErrorCode::stage_failed, "the integers leave a vertex undetermined", "quantization", {}};
      solution.set[at(v)][c] = wanted[c];
    }
  }
  return solution;
}

/// The fine map in fixed point: each vertex is rounded once, in its own sector, and every corner follows exactly.
template <class K>
[[nodiscard]] Expected<GridMap> fixed_point_map(const TriangleMesh<double>& mesh, const CutGraph& cut,
                                                const IntegerSolution<K>& integers, const std::vector<Complex>& z) {
  using detail::at;
  double largest = 1;
  for (const Complex& p : z) largest = std::max({largest, std::abs(p.real()), std::abs(p.imag())});
  if (!(largest < 1073741824.0))
    return Error{ErrorCode::stage_failed, "the map is too large for exact arithmetic", "extraction", {}};
  // Coordinates stay below 2^57, so orientation products stay below 2^116.
  int bits = 28;
  while (bits > 20 && std::ldexp(largest, bits) > 72057594037927936.0) --bits;
  GridMap map;
  map.unit = std::int64_t{1} << bits;
  const Index half_edges = mesh.halfedge_count();
  map.origin.resize(at(half_edges));
  map.twin.resize(at(half_edges));
  map.rotation = cut.rotation;
  map.corner.resize(at(half_edges));
  const auto translation = [&](Index h) {
    Gaussian t;
    for (const auto& term : cut.corner_translation[at(h)]) t += term.coefficient * integers.branch[at(term.variable)];
    return t;
  };
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const Index start = mesh.outgoing(v);
    if (start == no_index) continue;
    const Gaussian t = translation(start);
    const Complex base = rotated(z[at(start)] - to_field(t), -cut.corner_rotation[at(start)]);
    const auto unit = static_cast<double>(map.unit);
    Gaussian p{std::llround(base.real() * unit), std::llround(base.imag() * unit)};
    if (integers.set[at(v)][0]) p.re = integers.vertex[at(v)].re * map.unit;
    if (integers.set[at(v)][1]) p.im = integers.vertex[at(v)].im * map.unit;
    Index h = start;
    do {
      const Gaussian shift = translation(h);
      map.corner[at(h)] = rotated(p, cut.corner_rotation[at(h)]) + Gaussian{shift.re * map.unit, shift.im * map.unit};
      h = mesh.next_around(h);
    } while (h != no_index && h != start);
  }
  for (Index h = 0; h < half_edges; ++h) {
    map.origin[at(h)] = mesh.origin(h);
    map.twin[at(h)] = mesh.twin(h);
  }
  return map;
}

/// The coarse map itself as an integer-grid map.
[[nodiscard]] inline GridMap coarse_grid_map(const CoarseMap& coarse, const Quantization& integers) {
  GridMap map;
  map.unit = 2;
  map.origin = coarse.origin;
  map.twin = coarse.twin;
  map.rotation = coarse.rotation;
  map.corner.resize(coarse.origin.size());
  for (std::size_t h = 0; h < coarse.origin.size(); h += 3) {
    const Gaussian a = integers.edge[h], b = integers.edge[h + 1];
    map.corner[h] = {0, 0};
    map.corner[h + 1] = {2 * a.re, 2 * a.im};
    map.corner[h + 2] = {2 * (a.re + b.re), 2 * (a.im + b.im)};
  }
  return map;
}

}  // namespace quadrig
