// Distances of primitives, both ways.
#include "distances.hpp"

#include "quadrig/quality/distance.hpp"

namespace quadrig::gltf {
namespace {

struct Soup {
  Points<double> positions;
  Triangles faces;
};

/// The triangles of a primitive as they were read, over vertices of their own.
Soup input_soup(const Gathered& gathered, Index primitive, std::vector<Index>& vertices) {
  vertices.clear();
  for (Index t = 0; t < static_cast<Index>(gathered.triangles.rows()); ++t)
    if (gathered.triangle_primitive[at(t)] == primitive)
      for (int i = 0; i < 3; ++i) vertices.push_back(gathered.triangles(t, i));
  Soup soup;
  soup.positions.resize(static_cast<Eigen::Index>(vertices.size()), 3);
  soup.faces.resize(static_cast<Eigen::Index>(vertices.size() / 3), 3);
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    soup.positions.row(static_cast<Eigen::Index>(v)) = gathered.positions.row(vertices[v]);
    soup.faces(static_cast<Eigen::Index>(v / 3), static_cast<Eigen::Index>(v % 3)) = static_cast<Index>(v);
  }
  return soup;
}

Expected<GltfDistance> between(const Soup& input, const Soup& output, Context& context) {
  constexpr Index samples = 1500;
  const auto found =
      surface_distance(input.positions, input.faces, output.positions, output.faces, {.samples = samples}, context);
  if (!found) {
    if (found.error().code == ErrorCode::cancelled) return found.error();
    return GltfDistance{};  // one of them has no area
  }
  return GltfDistance{(found->to_input.mean + found->from_input.mean) / 2, found->hausdorff()};
}

/// The name of a morph target, where the mesh has names.
std::string target_name(const State& state, std::size_t mesh, std::size_t target) {
  const Json& meshes = array_of(state.json, "meshes");
  if (mesh >= meshes.size()) return {};
  const Json* extras = member(meshes[mesh], "extras");
  if (!extras) return {};
  const Json& names = array_of(*extras, "targetNames");
  return target < names.size() && names[target].is_string() ? names[target].get<std::string>() : std::string();
}

}  // namespace

Expected<std::vector<GltfPrimitive>> primitive_distances(const State& state, const Job& job, Context& context) {
  std::vector<GltfPrimitive> list;
  const Gathered& gathered = job.gathered;
  std::vector<Index> vertices;
  for (std::size_t p = 0; p < job.builders.size(); ++p) {
    const PrimitiveBuilder& builder = job.builders[p];
    if (builder.empty()) continue;
    const Primitive& primitive = gathered.primitives[p];
    GltfPrimitive& told = list.emplace_back();
    told.mesh = static_cast<Index>(primitive.mesh);
    told.primitive = static_cast<Index>(primitive.number);
    const Soup input = input_soup(gathered, static_cast<Index>(p), vertices);
    const Soup output{builder.positions(), builder.faces()};
    told.input_triangles = static_cast<Index>(input.faces.rows());
    told.triangles = static_cast<Index>(output.faces.rows());
    double area = 0;
    for (Eigen::Index f = 0; f < output.faces.rows(); ++f) {
      const auto corner = [&](int i) { return Vector3(output.positions.row(output.faces(f, i)).transpose()); };
      area += (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() / 2;
    }
    told.edge = std::sqrt(2 * area / std::max<double>(1, static_cast<double>(output.faces.rows())));
    if (input.positions.rows() > 0)
      told.size = (input.positions.colwise().maxCoeff() - input.positions.colwise().minCoeff()).norm();
    const Expected<GltfDistance> rest = between(input, output, context);
    if (!rest) return rest.error();
    told.rest = *rest;
    for (const Attribute& a : gathered.attributes) {
      if (a.target == Attribute::no_target || a.name != "POSITION" || a.target >= primitive.targets) continue;
      Soup moved_input = input, moved_output = output;
      for (std::size_t v = 0; v < vertices.size(); ++v)
        moved_input.positions.row(static_cast<Eigen::Index>(v)) += gathered.values.row(vertices[v]).segment<3>(a.first);
      moved_output.positions += builder.columns(a.first);
      if (moved_input.positions == input.positions && moved_output.positions == output.positions) continue;
      const Expected<GltfDistance> there = between(moved_input, moved_output, context);
      if (!there) return there.error();
      told.targets.push_back({static_cast<Index>(a.target), target_name(state, primitive.mesh, a.target), *there});
    }
  }
  return list;
}

}  // namespace quadrig::gltf
