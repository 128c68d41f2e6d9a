// Vertices into accessors.
#include "primitives.hpp"

#include <cstring>

#include "tangents.hpp"

namespace quadrig::gltf {
namespace {

template <class T>
void put(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

constexpr const char* source_name = "_SOURCE";

const char* type_of(Eigen::Index width) {
  static constexpr const char* types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  return types[width - 1];
}

/// One attribute of floats, with its bounds where asked.
std::size_t append_floats(State& state, std::size_t count, Eigen::Index width, bool bounds,
                          function_ref<double(std::size_t, Eigen::Index)> value) {
  NewAccessor made;
  std::string bytes;
  bytes.reserve(count * static_cast<std::size_t>(width) * 4);
  const auto columns = static_cast<std::size_t>(width);
  std::vector<double> low(columns, std::numeric_limits<double>::infinity()), high(columns, -low[0]);
  for (std::size_t v = 0; v < count; ++v)
    for (Eigen::Index k = 0; k < width; ++k) {
      const double exact = value(v, k);
      const float x = std::isfinite(exact) && std::abs(exact) < 3e38 ? static_cast<float>(exact) : 0.0F;
      put(bytes, x);
      const auto column = static_cast<std::size_t>(k);
      low[column] = std::min(low[column], static_cast<double>(x));
      high[column] = std::max(high[column], static_cast<double>(x));
    }
  made.type = type_of(width);
  made.count = count;
  made.bytes = bytes;
  made.row_bytes = columns * 4;
  made.target = 34962;
  if (bounds) made.low = low, made.high = high;
  return append_accessor(state, made);
}

}  // namespace

std::size_t append_matrices(State& state, std::span<const Eigen::Affine3d> matrices) {
  std::string bytes;
  for (const Eigen::Affine3d& matrix : matrices)
    for (int k = 0; k < 16; ++k) put(bytes, static_cast<float>(matrix.matrix().data()[k]));
  NewAccessor made;
  made.type = "MAT4";
  made.count = matrices.size();
  made.bytes = bytes;
  return append_accessor(state, made);
}

Index PrimitiveBuilder::vertex(std::uint64_t key, function_ref<Vertex()> make) {
  const auto [place, is_new] = known_.try_emplace(key, vertex_count());
  if (is_new) vertices_.push_back(make());
  return place->second;
}

Points<double> PrimitiveBuilder::positions() const {
  Points<double> rows(vertex_count(), 3);
  for (Index v = 0; v < vertex_count(); ++v) rows.row(v) = vertices_[at(v)].position.transpose();
  return rows;
}

Triangles PrimitiveBuilder::faces() const {
  return Eigen::Map<const Eigen::Matrix<Index, Eigen::Dynamic, 3, Eigen::RowMajor>>(
      indices_.data(), static_cast<Eigen::Index>(indices_.size() / 3), 3);
}

Points<double> PrimitiveBuilder::columns(Eigen::Index first) const {
  Points<double> rows(vertex_count(), 3);
  for (Index v = 0; v < vertex_count(); ++v) rows.row(v) = vertices_[at(v)].values.segment<3>(first).transpose();
  return rows;
}

void PrimitiveBuilder::make_tangents(const Gathered& gathered, const Primitive& primitive) {
  std::vector<Vector3> positions, normals;
  std::vector<Eigen::Vector2d> texture;
  // As floats, for that is how they are written: what is one point there has no direction.
  const auto written = [](double x) { return std::isfinite(x) ? static_cast<double>(static_cast<float>(x)) : 0.0; };
  for (const Vertex& vertex : vertices_) {
    positions.push_back(vertex.position);
    normals.push_back(vertex.normal);
    texture.emplace_back(written(vertex.values[primitive.texture]), written(vertex.values[primitive.texture + 1]));
  }
  const TangentGroups groups({positions, normals, texture}, indices_, quads_);
  const std::vector<Vector3> tangents = groups.directions({positions, normals, texture});

  // What morph targets do to them.
  std::vector<std::pair<Eigen::Index, std::vector<Vector3>>> changes;
  for (const std::size_t a : primitive.attributes) {
    const Attribute& attribute = gathered.attributes[a];
    if (attribute.target == Attribute::no_target || attribute.name != "TANGENT") continue;
    std::vector<Vector3> moved = positions, turned = normals;
    for (const std::size_t b : primitive.attributes) {
      const Attribute& other = gathered.attributes[b];
      if (other.target != attribute.target || (other.name != "POSITION" && other.name != "NORMAL")) continue;
      std::vector<Vector3>& what = other.name == "POSITION" ? moved : turned;
      for (std::size_t v = 0; v < vertices_.size(); ++v) what[v] += vertices_[v].values.segment<3>(other.first);
    }
    for (Vector3& n : turned) n = n.norm() > 0 ? Vector3(n.normalized()) : Vector3::UnitZ();
    std::vector<Vector3> change = groups.directions({moved, turned, texture});
    for (std::size_t g = 0; g < change.size(); ++g) change[g] -= tangents[g];
    changes.emplace_back(attribute.first, std::move(change));
  }

  std::vector<Index> owner(vertices_.size(), no_index);
  std::map<std::pair<Index, Index>, Index> doubles;
  for (std::size_t c = 0; c < indices_.size(); ++c) {
    const Index group = groups.of_corner(c);
    Index v = indices_[c];
    if (owner[static_cast<std::size_t>(v)] != no_index && owner[static_cast<std::size_t>(v)] != group) {
      const auto [place, is_new] = doubles.try_emplace({v, group}, vertex_count());
      if (is_new) {
        vertices_.push_back(Vertex(vertices_[static_cast<std::size_t>(v)]));
        owner.push_back(no_index);
      }
      v = indices_[c] = place->second;
    }
    if (owner[static_cast<std::size_t>(v)] == group) continue;
    owner[static_cast<std::size_t>(v)] = group;
    Vertex& vertex = vertices_[static_cast<std::size_t>(v)];
    vertex.tangent << tangents[static_cast<std::size_t>(group)], groups.sign(group);
    for (const auto& [first, change] : changes)
      vertex.values.segment<3>(first) = change[static_cast<std::size_t>(group)];
  }
}

Json PrimitiveBuilder::write(State& state, const Json& old, const Gathered& gathered, const Primitive& primitive,
                             bool source_map) const {
  const std::size_t count = vertices_.size();
  LocalJson attributes = Json::object();
  attributes["POSITION"] =
      append_floats(state, count, 3, true, [&](std::size_t v, Eigen::Index k) { return vertices_[v].position[k]; });
  bool with_normals = needs_normals_ || primitive.tangents;
  for (const std::size_t a : primitive.attributes)
    with_normals = with_normals || gathered.attributes[a].name == "NORMAL";  // of morph targets too
  if (with_normals)
    attributes["NORMAL"] =
        append_floats(state, count, 3, false, [&](std::size_t v, Eigen::Index k) { return vertices_[v].normal[k]; });
  if (primitive.tangents)
    attributes["TANGENT"] =
        append_floats(state, count, 4, false, [&](std::size_t v, Eigen::Index k) { return vertices_[v].tangent[k]; });
  LocalJson targets = Json::array();
  for (std::size_t t = 0; t < primitive.targets; ++t) targets.push_back(Json::object());
  for (const std::size_t a : primitive.attributes) {
    const Attribute& attribute = gathered.attributes[a];
    const bool colour = attribute.name.starts_with("COLOR_"), morph = attribute.target != Attribute::no_target;
    if (!morph && (attribute.name == "NORMAL" || (source_map && attribute.name == source_name))) continue;
    const std::size_t accessor =
        append_floats(state, count, attribute.width, morph, [&](std::size_t v, Eigen::Index k) {
          const double x = vertices_[v].values[attribute.first + k];
          return colour && !morph ? std::clamp(x, 0.0, 1.0) : x;
        });
    (morph ? targets[attribute.target] : attributes)[attribute.name] = accessor;
  }
  if (source_map)
    attributes[source_name] =
        append_floats(state, count, 4, false, [&](std::size_t v, Eigen::Index k) { return vertices_[v].source[k]; });

  // Influences by four; what is left of 1 after rounding goes to the strongest.
  std::size_t most = 1;
  for (const Vertex& vertex : vertices_) most = std::max(most, vertex.weights.size());
  const bool skinned = gathered.joints() > 0, wide = gathered.joints() > 256;
  for (std::size_t set = 0; skinned && 4 * set < most; ++set) {
    std::string numbers;
    for (const Vertex& vertex : vertices_)
      for (std::size_t k = 4 * set; k < 4 * set + 4; ++k) {
        const Index joint = k < vertex.weights.size() ? vertex.weights[k].first : 0;
        wide ? put(numbers, static_cast<std::uint16_t>(joint)) : put(numbers, static_cast<std::uint8_t>(joint));
      }
    NewAccessor made;
    made.type = "VEC4";
    made.component_type = wide ? 5123 : 5121;
    made.count = count;
    made.bytes = numbers;
    made.row_bytes = wide ? 8 : 4;
    made.target = 34962;
    attributes["JOINTS_" + std::to_string(set)] = append_accessor(state, made);
    attributes["WEIGHTS_" + std::to_string(set)] =
        append_floats(state, count, 4, false, [&](std::size_t v, Eigen::Index k) {
          const auto& weights = vertices_[v].weights;
          const std::size_t own = 4 * set + static_cast<std::size_t>(k);
          if (own >= weights.size()) return 0.0;
          if (own > 0) return weights[own].second;
          double rest = 1;
          for (std::size_t i = 1; i < weights.size(); ++i) rest -= static_cast<float>(weights[i].second);
          return rest;
        });
  }

  std::string numbers;
  const bool long_indices = count > 65535;
  for (const Index v : indices_)
    long_indices ? put(numbers, static_cast<std::uint32_t>(v)) : put(numbers, static_cast<std::uint16_t>(v));
  NewAccessor made;
  made.component_type = long_indices ? 5125 : 5123;
  made.count = indices_.size();
  made.bytes = numbers;
  made.target = 34963;
  LocalJson result = Json(old);
  replace(result["attributes"], std::move(attributes));
  result["indices"] = append_accessor(state, made);
  if (member(result, "mode")) result["mode"] = 4;
  Json& extras = result["extras"];
  if (extras.is_null() || extras.is_object()) extras[quads_mark] = quads_;
  if (const Json* extensions = member(result, "extensions"); extensions && member(*extensions, draco_name)) {
    dismantle(result["extensions"][draco_name]);
    result["extensions"].erase(draco_name);
    if (result["extensions"].empty()) result.erase("extensions");
  }
  if (primitive.targets > 0) replace(result["targets"], std::move(targets));
  return std::move(static_cast<Json&>(result));
}

}  // namespace quadrig::gltf
