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

}  // namespace quadrig
