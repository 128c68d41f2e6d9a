// Attributes of primitives as the file has them.
#include "gather.hpp"

namespace quadrig {
namespace gltf {
namespace {

/// The accessor that a primitive has under the name, or null.
const Json* named_accessor(const Json& primitive, std::string_view name) {
  if (name.starts_with("targets[")) {
    const auto close = name.find("].");
    if (close == std::string_view::npos || close == 8 || close > 14) return nullptr;
    std::size_t number = 0;
    for (const char digit : name.substr(8, close - 8)) {
      if (digit < '0' || digit > '9') return nullptr;
      number = 10 * number + static_cast<std::size_t>(digit - '0');
    }
    const Json& targets = array_of(primitive, "targets");
    return number < targets.size() ? member(targets[number], std::string(name.substr(close + 2)).c_str()) : nullptr;
  }
  const Json* attributes = member(primitive, "attributes");
  return attributes ? member(*attributes, std::string(name).c_str()) : nullptr;
}

Status read_vertices(State& state, const Json& primitive, const std::string& where, std::string_view name,
                     Budget& budget, Cache& cache, GltfVertices& out) {
  const Expected<PrimitiveReader> reader = PrimitiveReader::open(state, primitive, where, budget, cache);
  if (!reader) return reader.error();
  if (!reader->is_surface()) return {};
  const std::size_t vertices = reader->vertices();
  const std::vector<std::size_t>& list = reader->corners();
  const auto spend = [&](std::size_t numbers) { return charge(state, budget, numbers, 1, where); };
  if (Status status = spend(3 * vertices + 3 * triangle_count(reader->mode(), list.size())); !status) return status;
  out.positions = reader->positions();
  out.triangles.resize(static_cast<Eigen::Index>(triangle_count(reader->mode(), list.size())), 3);
  for (Eigen::Index t = 0; t < out.triangles.rows(); ++t) {
    const auto own = triangle_of(reader->mode(), list, static_cast<std::size_t>(t));
    for (int i = 0; i < 3; ++i) out.triangles(t, i) = static_cast<Index>(own[static_cast<std::size_t>(i)]);
  }
  if (const Json* extras = member(primitive, "extras"))
    if (const Json* quads = member(*extras, quads_mark))
      out.quads =
          static_cast<Index>(std::min(whole(*quads).value_or(0), static_cast<std::size_t>(out.triangles.rows()) / 2));
  const Json* wanted = named_accessor(primitive, name);
  if (!wanted) return {};
  const auto values = reader->values(std::string(name), *wanted, where);
  if (!values) return values.error();
  if (Status status = spend(static_cast<std::size_t>((*values)->size())); !status) return status;
  out.values = **values;
  return {};
}

}  // namespace
}  // namespace gltf

Index gltf_triangle_count(const GltfDocument& document) {
  using gltf::member;
  const gltf::Json& json = document.state().json;
  const gltf::Json& accessors = gltf::array_of(json, "accessors");
  std::size_t triangles = 0;
  for (const gltf::Json& mesh : gltf::array_of(json, "meshes"))
    for (const gltf::Json& primitive : gltf::array_of(mesh, "primitives")) {
      const gltf::Json *corners = member(primitive, "indices"), *mode = member(primitive, "mode");
      if (const gltf::Json* attributes = member(primitive, "attributes"); attributes && !corners)
        corners = member(*attributes, "POSITION");
      const auto accessor = corners ? gltf::whole(*corners) : std::nullopt;
      if (!accessor || *accessor >= accessors.size()) continue;
      const gltf::Json* count = member(accessors[*accessor], "count");
      const std::size_t kind = mode ? gltf::whole(*mode).value_or(0) : 4,
                        n = count ? gltf::whole(*count).value_or(0) : 0;
      if (kind == 4) triangles += n / 3;
      if ((kind == 5 || kind == 6) && n > 2) triangles += n - 2;
    }
  return static_cast<Index>(std::min<std::size_t>(triangles, std::numeric_limits<Index>::max()));
}

Expected<std::vector<GltfVertices>> gltf_vertices(const GltfDocument& document, std::string_view name,
                                                  Context& context) {
  gltf::State& state = document.state();
  gltf::Budget budget;
  gltf::Cache cache;
  std::vector<GltfVertices> all;
  const gltf::Json& meshes = gltf::array_of(state.json, "meshes");
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const gltf::Json& primitives = gltf::array_of(meshes[m], "primitives");
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      if (context.cancelled()) return cancelled_error("gltf");
      GltfVertices& one = all.emplace_back();
      one.mesh = static_cast<Index>(m);
      one.primitive = static_cast<Index>(p);
      const std::string where = gltf::numbered("meshes", m) + "." + gltf::numbered("primitives", p);
      if (Status status = gltf::read_vertices(state, primitives[p], where, name, budget, cache, one); !status)
        return status.error();
    }
  }
  return all;
}

Expected<PolygonMesh> gltf_polygons(const GltfDocument& document, Context& context) {
  const Expected<std::vector<GltfVertices>> all = gltf_vertices(document, "POSITION", context);
  if (!all) return all.error();
  PolygonMesh mesh;
  std::map<std::array<double, 3>, Index> known;
  std::vector<Vector3> positions;
  for (const GltfVertices& one : *all) {
    std::vector<Index> number;
    for (Eigen::Index v = 0; v < one.positions.rows(); ++v) {
      const Vector3 p = one.positions.row(v).transpose() + Vector3::Zero();  // −0 is 0
      const auto [place, is_new] = known.try_emplace({p[0], p[1], p[2]}, static_cast<Index>(positions.size()));
      if (is_new) positions.push_back(p);
      number.push_back(place->second);
    }
    const auto corner = [&](Eigen::Index t, int k) { return number[gltf::at(one.triangles(t, k))]; };
    for (Eigen::Index t = 0; t < one.triangles.rows(); ++t) {
      if (t < 2 * one.quads) {
        mesh.add_polygon(std::array{corner(t, 0), corner(t, 1), corner(t, 2), corner(t + 1, 2)});
        ++t;
      } else {
        mesh.add_polygon(std::array{corner(t, 0), corner(t, 1), corner(t, 2)});
      }
    }
  }
  if (mesh.polygon_count() == 0)
    return document.state().bad("meshes", "there are no triangles", "give a file with some");
  mesh.positions.resize(static_cast<Eigen::Index>(positions.size()), 3);
  for (std::size_t v = 0; v < positions.size(); ++v)
    mesh.positions.row(static_cast<Eigen::Index>(v)) = positions[v].transpose();
  return mesh;
}

}  // namespace quadrig
