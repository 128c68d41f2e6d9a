// Definitions of quality/guidance.hpp.
#pragma once

#include <numbers>

#include "quadrig/dominance.hpp"
#include "quadrig/quality/guidance.hpp"
#include "quadrig/quality/topology.hpp"
#include "quadrig/skinning.hpp"
#include "quadrig/transfer.hpp"

namespace quadrig {

QUADRIG_INLINE std::vector<std::vector<Index>> edge_loops(const Quads& quads) {
  const auto sides = static_cast<std::size_t>(quads.size());
  const auto next = [](std::size_t h) { return h % 4 == 3 ? h - 3 : h + 1; };
  const auto origin = [&](std::size_t h) { return quads.data()[h]; };
  const Index vertices = sides > 0 ? quads.maxCoeff() + 1 : 0;
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> twin(sides, none);
  std::vector<Index> valence(detail::at(vertices), 0);
  std::vector<char> open(detail::at(vertices), 0);  // has a side without a twin
  detail::for_each_edge(detail::sorted_by_edge(vertices, quads), [&](std::span<const detail::SortedSide> edge) {
    const auto low = detail::at(edge[0].low), high = detail::at(edge[0].high);
    ++valence[low];
    ++valence[high];
    if (edge.size() != 2) {
      open[low] = open[high] = 1;
      return;
    }
    twin[detail::at(edge[0].halfedge)] = detail::at(edge[1].halfedge);
    twin[detail::at(edge[1].halfedge)] = detail::at(edge[0].halfedge);
  });
  const auto straight_on = [&](std::size_t h) {  // the edge opposite at the target, or none
    const auto v = static_cast<std::size_t>(origin(next(h)));
    if (valence[v] != 4 || open[v] != 0) return none;
    return next(twin[next(h)]);
  };
  std::vector<char> seen(sides, 0);
  std::vector<std::vector<Index>> loops;
  for (std::size_t start = 0; start < sides; ++start) {
    if (seen[start] || twin[start] == none) continue;
    std::vector<Index> loop;
    std::size_t h = start;
    do {
      seen[h] = 1;
      if (twin[h] != none) seen[twin[h]] = 1;
      loop.push_back(static_cast<Index>(h));
      h = straight_on(h);
    } while (h != none && !seen[h]);  // a chain that meets an older one is open, as that was
    if (h == start) loops.push_back(std::move(loop));
  }
  return loops;
}

namespace detail {

/// How often a closed polygon goes round an axis.
inline int winding(const std::vector<Vector3>& polygon, const Vector3& centre, const Vector3& axis) {
  const Vector3 x = axis.unitOrthogonal(), y = axis.cross(x);
  double turned = 0;
  const auto angle = [&](const Vector3& p) { return elementary::atan2((p - centre).dot(y), (p - centre).dot(x)); };
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const double step = angle(polygon[(k + 1) % polygon.size()]) - angle(polygon[k]);
    turned += std::remainder(step, 2 * std::numbers::pi);
  }
  return static_cast<int>(std::lround(turned / (2 * std::numbers::pi)));
}

}  // namespace detail

QUADRIG_INLINE Status GuidanceOptions::validate() const {
  for (const auto& [field, value] : {std::pair("rule_limit", rule_limit), {"least_projection", least_projection}})
    if (!(value >= 0 && value <= 1))
      return Error{ErrorCode::bad_option, std::string(field) + " is out of range", "GuidanceOptions",
                   "give a number in [0, 1]"};
  return {};
}

QUADRIG_INLINE Expected<GuidanceFigures> guidance_figures(const TriangleMesh<double>& input, const Rig& rig,
                                                          const QuadMesh& mesh, const GuidanceOptions& options) {
  if (Status status = options.validate(); !status) return status.error();
  const Expected<Dominance> created = Dominance::create(input, rig);
  if (!created) return created.error();
  const Dominance& dominance = *created;
  if (mesh.source.size() != static_cast<std::size_t>(mesh.vertex_count()))
    return Error{ErrorCode::bad_input, "not one source point a vertex", "quads", "give quads that know their source"};
  const auto weights = transfer_weights(input, rig.weights, mesh.source, std::max<Index>(1, rig.skeleton.bone_count()));
  if (!weights) return weights.error();

  GuidanceFigures figures;
  const PolygonMesh polygons = to_polygons(mesh);
  const detail::PolygonTopology topology(polygons);
  const auto source_face = [&](Index v) { return mesh.source[static_cast<std::size_t>(v)].face; };
  const auto ruler = [&](Index f) {
    return dominance.omega(f, 1) > options.rule_limit ? dominance.share(f, 1).bone : no_index;
  };

  std::vector<double> angles;
  for (const auto& edge : topology.edges) {
    const Index f = source_face(edge.low), g = source_face(edge.high);
    const Index bone = ruler(f);
    if (bone == no_index || ruler(g) != bone || !rig.skeleton.bones[static_cast<std::size_t>(bone)].has_direction)
      continue;
    const Vector3 sum = input.normal(f) + input.normal(g);
    if (!(sum.norm() > 1e-6)) continue;
    const Vector3 normal = sum.normalized();
    const auto tangent = [&](const Vector3& v) { return Vector3(v - v.dot(normal) * normal); };
    const Vector3 along = tangent(rig.skeleton.bones[static_cast<std::size_t>(bone)].direction());
    const Vector3 e = tangent((mesh.positions.row(edge.high) - mesh.positions.row(edge.low)).transpose());
    if (!(along.norm() > options.least_projection) || !(e.norm() > 0)) continue;
    const double angle = elementary::atan2(along.cross(e).norm(), std::abs(along.dot(e))) * 180 / std::numbers::pi;
    angles.push_back(std::min(angle, 90 - angle));
  }
  figures.bone_edges = static_cast<Index>(angles.size());
  for (const double angle : angles) figures.bone_angle_mean_degrees += angle / static_cast<double>(angles.size());
  figures.bone_angle_median_degrees = quantile(angles, 0.5);
  figures.bone_angle_p99_degrees = quantile(std::move(angles), 0.99);

  std::vector<RegionDensity> region(static_cast<std::size_t>(rig.skeleton.bone_count()) + 1);  // the last one: blending
  const auto region_of = [&](Index f) -> RegionDensity& {
    const Index bone = ruler(f);
    return bone == no_index ? region.back() : region[static_cast<std::size_t>(bone)];
  };
  for (Index f = 0; f < input.face_count(); ++f) region_of(f).area_share += input.area(f) / input.total_area();
  for (Index q = 0; q < mesh.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) region_of(source_face(mesh.quads(q, i))).quad_share += 0.25 / mesh.quad_count();
  figures.regions.push_back(region.back());
  for (std::size_t b = 0; b + 1 < region.size(); ++b) {
    region[b].bone = static_cast<Index>(b);
    if (region[b].area_share > 0) figures.regions.push_back(region[b]);
  }

  Index irregular = 0, blending_irregular = 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const auto i = static_cast<std::size_t>(v);
    if (topology.valence[i] == 0 || topology.valence[i] == 4 || topology.on_boundary[i]) continue;
    ++irregular;
    blending_irregular += ruler(source_face(v)) == no_index;
  }
  if (irregular > 0) figures.irregular_where_blending = static_cast<double>(blending_irregular) / irregular;

  const std::vector<std::vector<Index>> loops = edge_loops(mesh.quads);
  figures.hinge_loops.assign(static_cast<std::size_t>(rig.skeleton.bone_count()), 0);
  for (Index b = 0; b < rig.skeleton.bone_count(); ++b) {
    const Bone& bone = rig.skeleton.bones[static_cast<std::size_t>(b)];
    if (bone.parent == no_index || bone.parent == b) continue;
    // The axis of the limb at the hinge; a loop in the blend is held partly by what turns there, partly by what does
    // not.
    Vector3 axis = bone.direction() + rig.skeleton.bones[static_cast<std::size_t>(bone.parent)].direction();
    if (!(axis.norm() > 1e-6)) continue;
    axis.normalize();
    std::vector<char> turns(static_cast<std::size_t>(rig.skeleton.bone_count()), 0);
    for (const Index below : bones_below(rig.skeleton, b)) turns[static_cast<std::size_t>(below)] = 1;
    const auto turning_share = [&](Index v) {
      double share = 0;
      for (SkinWeights::InnerIterator it(*weights, v); it; ++it)
        if (turns[static_cast<std::size_t>(it.col())]) share += it.value();
      return share;
    };
    for (const auto& loop : loops) {
      std::vector<Vector3> polygon;
      double mean = 0;
      bool blends = true;
      for (const Index h : loop) {
        const Index v = mesh.quads.data()[h];
        const double share = turning_share(v);
        blends = blends && share > 0.01 && share < 0.99;
        mean += share / static_cast<double>(loop.size());
        if (!blends) break;
        polygon.push_back(mesh.positions.row(v).transpose());
      }
      if (blends && mean > 0.05 && mean < 0.95 && std::abs(detail::winding(polygon, bone.head, axis)) == 1)
        ++figures.hinge_loops[static_cast<std::size_t>(b)];
    }
  }
  return figures;
}

}  // namespace quadrig
