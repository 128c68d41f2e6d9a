// Definitions of quality/validity.hpp.
#pragma once

#include <map>

#include "quadrig/quality/topology.hpp"
#include "quadrig/quality/validity.hpp"

namespace quadrig {

QUADRIG_INLINE std::string_view describe(ValidityRule rule) {
  switch (rule) {
    case ValidityRule::finite_positions:
      return "every position is finite";
    case ValidityRule::vertices_in_range:
      return "every corner is a vertex of the mesh";
    case ValidityRule::no_degenerate_quads:
      return "no quad repeats a vertex";
    case ValidityRule::no_duplicate_quads:
      return "no two quads have the same vertices";
    case ValidityRule::manifold_edges:
      return "no edge has more than two quads";
    case ValidityRule::manifold_vertices:
      return "the quads around every vertex form one fan";
    case ValidityRule::consistent_orientation:
      return "neighbouring quads turn the same way";
    case ValidityRule::no_unused_vertices:
      return "every vertex belongs to a quad";
    case ValidityRule::same_components:
      return "every component of the input is there once";
    case ValidityRule::same_genus:
      return "every component keeps its genus";
    case ValidityRule::same_boundary_loops:
      return "every component keeps its boundary loops";
    case ValidityRule::positive_scaled_jacobian:
      return "no quad has a scaled Jacobian of 0 or less";
    case ValidityRule::on_the_surface:
      return "every vertex lies on the input surface";
    case ValidityRule::one_weight_row_a_vertex:
      return "every vertex has its weights";
    case ValidityRule::nonnegative_weights:
      return "no weight is negative";
    case ValidityRule::weights_sum_to_one:
      return "the weights of every vertex sum to 1";
    case ValidityRule::few_influences:
      return "no vertex has more influences than asked for";
  }
  return "unknown rule";
}

QUADRIG_INLINE Error ValidityReport::error() const {
  const Violation& first = violations.front();
  std::string what = "broken rule: " + std::string(describe(first.rule)) + " (" + first.what;
  if (first.count > 1) what += ", the first of " + std::to_string(first.count);
  what += ")";
  if (violations.size() > 1) what += " and " + std::to_string(violations.size() - 1) + " more rules";
  return {ErrorCode::stage_failed, std::move(what), first.where, "ask for more quads, or report the asset"};
}

namespace detail {

/// Collects violations, one a rule, in the order of their rules' first break.
class ViolationList {
 public:
  explicit ViolationList(std::vector<Violation>& list) : list_(list) {}
  void add(ValidityRule rule, std::string where, std::string what) {
    for (Violation& known : list_)
      if (known.rule == rule) {
        ++known.count;
        return;
      }
    list_.push_back({rule, 1, std::move(where), std::move(what)});
  }

 private:
  std::vector<Violation>& list_;
};

}  // namespace detail

QUADRIG_INLINE ValidityReport check_validity(const TriangleMesh<double>& input, const QuadMesh& mesh,
                                             const SkinWeights* weights, const ValidityOptions& options) {
  using Rule = ValidityRule;
  ValidityReport report;
  detail::ViolationList broken(report.violations);
  const auto quad = [](Index q) { return "quad " + std::to_string(q); };
  const auto vertex = [](Index v) { return "vertex " + std::to_string(v); };
  const Index n = mesh.vertex_count();

  for (Index v = 0; v < n; ++v)
    if (!mesh.positions.row(v).allFinite()) broken.add(Rule::finite_positions, vertex(v), "not finite");
  for (Index q = 0; q < mesh.quad_count(); ++q)
    for (int i = 0; i < 4; ++i)
      if (mesh.quads(q, i) < 0 || mesh.quads(q, i) >= n)
        broken.add(Rule::vertices_in_range, quad(q), "corner " + std::to_string(mesh.quads(q, i)));
  if (!report.valid()) return report;  // nothing else can be looked at

  const PolygonMesh polygons = to_polygons(mesh);
  report.statistics = mesh_statistics(polygons);
  const detail::PolygonTopology own(polygons);
  std::map<std::array<Index, 4>, Index> seen;
  for (Index q = 0; q < mesh.quad_count(); ++q) {
    std::array<Index, 4> set{mesh.quads(q, 0), mesh.quads(q, 1), mesh.quads(q, 2), mesh.quads(q, 3)};
    std::sort(set.begin(), set.end());
    for (std::size_t i = 0; i + 1 < set.size(); ++i)
      if (set[i] == set[i + 1]) {
        broken.add(Rule::no_degenerate_quads, quad(q), vertex(set[i]) + " twice");
        break;
      }
    if (const auto [known, is_new] = seen.emplace(set, q); !is_new)
      broken.add(Rule::no_duplicate_quads, quad(q), "the vertices of quad " + std::to_string(known->second));
    if (const double jacobian = scaled_jacobian(mesh.positions, mesh.quads.row(q)); !(jacobian > 0))
      broken.add(Rule::positive_scaled_jacobian, quad(q), "scaled Jacobian " + std::to_string(jacobian));
  }
  for (const auto& edge : own.edges) {
    const std::string where = "edge " + std::to_string(edge.low) + " - " + std::to_string(edge.high);
    if (edge.faces() > 2) broken.add(Rule::manifold_edges, where, std::to_string(edge.faces()) + " quads");
    if (edge.faces() == 2 && edge.forward != 1)
      broken.add(Rule::consistent_orientation, where, "both quads run it the same way");
  }
  for (Index v = 0; v < n; ++v) {
    const auto i = static_cast<std::size_t>(v);
    if (own.valence[i] == 0) broken.add(Rule::no_unused_vertices, vertex(v), "in no quad");
    if (own.fans[i] > 1) broken.add(Rule::manifold_vertices, vertex(v), std::to_string(own.fans[i]) + " fans");
  }

  // On the surface, by the point of it that each vertex says it is.
  const bool has_source = mesh.source.size() == static_cast<std::size_t>(n);
  if (!has_source)
    broken.add(Rule::on_the_surface, "source",
               std::to_string(mesh.source.size()) + " points for " + std::to_string(n) + " vertices");
  bool sound_source = has_source;
  for (Index v = 0; has_source && v < n; ++v) {
    const SurfacePoint& point = mesh.source[static_cast<std::size_t>(v)];
    if (point.face < 0 || point.face >= input.face_count() || !(point.barycentric.minCoeff() >= -1e-9) ||
        !(std::abs(point.barycentric.sum() - 1) <= 1e-9)) {
      broken.add(Rule::on_the_surface, vertex(v), "its source is no point of the input");
      sound_source = false;
      continue;
    }
    const double distance = (position(input, point) - mesh.positions.row(v).transpose()).norm();
    report.largest_surface_distance = std::max(report.largest_surface_distance, distance);
    if (!(distance <= options.surface_tolerance * input.diagonal()))
      broken.add(Rule::on_the_surface, vertex(v), "distance " + std::to_string(distance));
  }

  // The same surface, component by component: each belongs to the one its vertices lie on.
  const detail::PolygonTopology theirs(to_polygons(input));
  if (own.components.size() != theirs.components.size())
    broken.add(Rule::same_components, "mesh",
               std::to_string(own.components.size()) + " components, the input has " +
                   std::to_string(theirs.components.size()));
  const bool manifold = report.statistics.genus.has_value();
  if (manifold && sound_source && own.components.size() == theirs.components.size()) {
    std::vector<Index> partner(own.components.size(), no_index);
    std::vector<char> taken(theirs.components.size(), 0);
    for (Index v = 0; v < n; ++v) {
      const Index mine = own.component_of[static_cast<std::size_t>(v)];
      if (mine == no_index) continue;
      const Index face = mesh.source[static_cast<std::size_t>(v)].face;
      const Index other = theirs.component_of[static_cast<std::size_t>(input.faces()(face, 0))];
      Index& known = partner[static_cast<std::size_t>(mine)];
      if (known == no_index) {
        known = other;
        if (taken[static_cast<std::size_t>(other)])
          broken.add(Rule::same_components, vertex(v), "two components on one of the input");
        taken[static_cast<std::size_t>(other)] = 1;
      } else if (known != other) {
        broken.add(Rule::same_components, vertex(v), "one component on two of the input");
      }
    }
    for (std::size_t c = 0; c < own.components.size(); ++c) {
      if (partner[c] == no_index) continue;
      const auto &mine = own.components[c], &other = theirs.components[static_cast<std::size_t>(partner[c])];
      const std::string where = "component of quad " + std::to_string(mine.first_face);
      if (mine.boundary_loops != other.boundary_loops)
        broken.add(Rule::same_boundary_loops, where,
                   std::to_string(mine.boundary_loops) + ", the input has " + std::to_string(other.boundary_loops));
      if (mine.genus() != other.genus())
        broken.add(Rule::same_genus, where,
                   std::to_string(mine.genus()) + ", the input has " + std::to_string(other.genus()));
    }
  }

  if (weights) {
    if (weights->rows() != n) {
      broken.add(Rule::one_weight_row_a_vertex, "weights",
                 std::to_string(weights->rows()) + " rows for " + std::to_string(n) + " vertices");
    } else {
      for (Index v = 0; v < n; ++v) {
        double sum = 0, least = 0;
        Index influences = 0;
        for (SkinWeights::InnerIterator it(*weights, v); it; ++it) {
          sum += it.value();
          least = std::min(least, it.value());
          influences += it.value() != 0;
        }
        if (least < 0) broken.add(Rule::nonnegative_weights, vertex(v), "weight " + std::to_string(least));
        if (!(std::abs(sum - 1) <= options.weight_tolerance))
          broken.add(Rule::weights_sum_to_one, vertex(v), "sum " + std::to_string(sum));
        if (influences > options.influences)
          broken.add(Rule::few_influences, vertex(v), std::to_string(influences) + " influences");
      }
    }
  }
  return report;
}

}  // namespace quadrig
