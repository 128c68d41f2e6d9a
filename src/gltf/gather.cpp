// Primitives into one surface.
#include "gather.hpp"

namespace quadrig::gltf {

std::size_t Gatherer::column(const std::string& name, std::size_t target, Eigen::Index width) {
  const auto [place, is_new] = columns_.try_emplace({name, target, width}, out_.attributes.size());
  if (!is_new) return place->second;
  const Eigen::Index first = out_.attributes.empty() ? 0 : out_.attributes.back().first + out_.attributes.back().width;
  out_.attributes.push_back({name, target, first, width});
  return place->second;
}

Status Gatherer::morphs(const PrimitiveReader& reader, const Json& targets, const std::string& where,
                        Primitive& primitive, std::vector<Loose>& loose) {
  primitive.targets = targets.size();
  const auto add = [&](std::size_t t, const std::string& name, const Json* moved) -> Status {
    const bool vector = name == "POSITION" || name == "NORMAL";
    const std::string there = where + "." + numbered("targets", t) + "." + name;
    std::shared_ptr<const Values> read;
    if (moved) {
      const auto values = reader.values({}, *moved, there);
      if (!values) return values.error();
      if (vector && (*values)->cols() != 3) return state_.bad(there, "is not of three numbers");
      if ((*values)->cols() > 4) return {};
      read = *values;
    }
    primitive.attributes.push_back(column(name, t, read ? read->cols() : 3));
    if (read) loose.push_back({primitive.attributes.back(), read});
    return {};
  };
  for (std::size_t t = 0; t < targets.size(); ++t) {
    if (Status status = add(t, "POSITION", member(targets[t], "POSITION")); !status) return status;
    if (!targets[t].is_object()) continue;
    for (const auto& [name, accessor] : targets[t].items()) {
      if (name == "TANGENT") {  // made anew, and only beside tangents to change
        if (!primitive.tangents) continue;
        primitive.attributes.push_back(column(name, t, 3));
      } else if (name == "NORMAL" || name.starts_with("TEXCOORD_") || name.starts_with("COLOR_") ||
                 name.starts_with("_")) {
        if (Status status = add(t, name, &accessor); !status) return status;
      }
    }
  }
  return {};
}

/// The texture coordinates that tangents follow: those of the material's normal map, else the first.
Eigen::Index Gatherer::texture_of_normals(const Json& primitive, const Primitive& made) const {
  std::string wanted = "TEXCOORD_0";
  const Json* number = member(primitive, "material");
  const Json& materials = array_of(state_.json, "materials");
  const std::size_t material = number ? whole(*number).value_or(materials.size()) : materials.size();
  if (material < materials.size())
    if (const Json* map = member(materials[material], "normalTexture"))
      if (const Json* set = member(*map, "texCoord"))
        if (const auto n = whole(*set)) wanted = "TEXCOORD_" + std::to_string(*n);
  for (const std::size_t a : made.attributes) {
    const Attribute& attribute = out_.attributes[a];
    if (attribute.target == Attribute::no_target && attribute.width == 2 && attribute.name == wanted)
      return attribute.first;
  }
  return Primitive::no_texture;
}

Status Gatherer::add(std::size_t mesh, std::size_t number, const Json& json) {
  const std::string where = numbered("meshes", mesh) + "." + numbered("primitives", number);
  const Json* attributes = member(json, "attributes");
  const bool has_joints = attributes && member(*attributes, "JOINTS_0") && member(*attributes, "WEIGHTS_0");
  if (has_joints != (joints_ > 0)) return {};
  const Expected<PrimitiveReader> opened = PrimitiveReader::open(state_, json, where, budget_, cache_);
  if (!opened) return opened.error();
  const PrimitiveReader& reader = *opened;
  if (!reader.is_surface()) return {};
  const Values& points = reader.positions();
  const std::size_t vertices = reader.vertices();
  const std::vector<std::size_t>& list = reader.corners();

  // What the vertices carry.
  Primitive primitive;
  primitive.mesh = mesh;
  primitive.number = number;
  if (const Json* material = member(json, "material")) primitive.material = whole(*material);
  std::vector<Loose> loose;
  std::vector<std::pair<std::shared_ptr<const Values>, std::shared_ptr<const Values>>> sets;
  for (const auto& [name, accessor] : attributes->items()) {
    const std::string there = where + "." + name;
    primitive.tangents = primitive.tangents || name == "TANGENT";
    if (name == "POSITION" || name == "TANGENT" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_"))
      continue;
    if (!name.starts_with("TEXCOORD_") && !name.starts_with("COLOR_") && !name.starts_with("_") && name != "NORMAL")
      continue;
    const auto values = reader.values(name, accessor, there);
    if (!values) return values.error();
    if ((*values)->cols() > 4) continue;
    loose.push_back({column(name, Attribute::no_target, (*values)->cols()), *values});
    primitive.attributes.push_back(loose.back().attribute);
  }
  for (std::size_t set = 0; joints_ > 0; ++set) {
    const std::string joints_name = "JOINTS_" + std::to_string(set), shares_name = "WEIGHTS_" + std::to_string(set);
    const Json *joints = member(*attributes, joints_name.c_str()), *shares = member(*attributes, shares_name.c_str());
    if (!joints || !shares) break;
    const auto a = reader.values(joints_name, *joints, where + "." + joints_name),
               b = reader.values(shares_name, *shares, where + "." + shares_name);
    if (!a) return a.error();
    if (!b) return b.error();
    if ((*a)->cols() != 4 || (*b)->cols() != 4) return state_.bad(where, "has joints or weights not by four");
    sets.emplace_back(*a, *b);
  }
  primitive.texture = texture_of_normals(json, primitive);
  if (primitive.tangents && primitive.texture == Primitive::no_texture)
    primitive.tangents = false, lost_tangents = true;
  if (Status status = morphs(reader, array_of(json, "targets"), where, primitive, loose); !status) return status;

  // Vertices that triangles use, in their first order.
  const std::size_t width = out_.attributes.empty()
                                ? 0
                                : static_cast<std::size_t>(out_.attributes.back().first + out_.attributes.back().width);
  if (!points.allFinite()) return state_.bad(where + ".POSITION", "has numbers that are not finite");
  std::vector<Index> renumbered(vertices, no_index);
  const auto vertex = [&](std::size_t v) {
    if (renumbered[v] != no_index) return renumbered[v];
    renumbered[v] = static_cast<Index>(positions_.size());
    positions_.push_back(points.row(static_cast<Eigen::Index>(v)).transpose());
    std::vector<double>& row = rows_.emplace_back(width, 0.0);
    for (const Loose& one : loose)
      for (Eigen::Index k = 0; k < one.values->cols(); ++k)
        row[static_cast<std::size_t>(out_.attributes[one.attribute].first + k)] =
            (*one.values)(static_cast<Eigen::Index>(v), k);
    auto& influences = weights.rows.emplace_back();
    for (const auto& [joints, shares] : sets)
      for (Eigen::Index k = 0; k < 4; ++k) {
        const double share = (*shares)(static_cast<Eigen::Index>(v), k);
        if (share == 0) continue;
        const double joint = (*joints)(static_cast<Eigen::Index>(v), k);
        influences.emplace_back(joint >= 0 && joint < joints_ ? static_cast<Index>(joint) : no_index, share);
      }
    return renumbered[v];
  };
  const std::size_t corners = list.size(), count = triangle_count(reader.mode(), corners);
  if (positions_.size() + std::min(vertices, corners) > 700'000'000U || triangles_.size() + count > 700'000'000U)
    return state_.unsupported(where, "makes the surface larger than 2^31 / 3", "use a smaller file");
  // Every corner and vertex is copied with what it carries: that counts against the limit too.
  if (Status status = charge(state_, budget_, std::min(vertices, corners), width + 3 + 8 * sets.size(), where); !status)
    return status;
  if (Status status = charge(state_, budget_, count, Budget::numbers_a_triangle, where); !status) return status;
  for (std::size_t t = 0; t < count; ++t) {
    const std::array<std::size_t, 3> own = triangle_of(reader.mode(), list, t);
    const Index a = vertex(own[0]), b = vertex(own[1]), c = vertex(own[2]);
    triangles_.push_back({a, b, c});
    out_.triangle_primitive.push_back(static_cast<Index>(out_.primitives.size()));
    out_.triangle_number.push_back(static_cast<Index>(t));
  }
  out_.primitives.push_back(std::move(primitive));
  return {};
}

Status Gatherer::finish() {
  const Eigen::Index width = out_.attributes.empty() ? 0 : out_.attributes.back().first + out_.attributes.back().width;
  const std::size_t wide = static_cast<std::size_t>(width) + 1;
  if (Status status = charge(state_, budget_, rows_.size(), wide, out_.surface.label()); !status) return status;
  out_.positions.resize(static_cast<Eigen::Index>(positions_.size()), 3);
  out_.values = Values::Zero(static_cast<Eigen::Index>(rows_.size()), width);
  for (std::size_t v = 0; v < positions_.size(); ++v) {
    out_.positions.row(static_cast<Eigen::Index>(v)) = positions_[v].transpose();
    for (std::size_t k = 0; k < rows_[v].size(); ++k)
      out_.values(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(k)) = rows_[v][k];
  }
  out_.triangles.resize(static_cast<Eigen::Index>(triangles_.size()), 3);
  for (std::size_t t = 0; t < triangles_.size(); ++t)
    for (int i = 0; i < 3; ++i)
      out_.triangles(static_cast<Eigen::Index>(t), i) = triangles_[t][static_cast<std::size_t>(i)];
  return {};
}

}  // namespace quadrig::gltf
