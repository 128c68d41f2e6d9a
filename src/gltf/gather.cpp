// Primitives into one surface.
#include "gather.hpp"

namespace quadrig::gltf {

Status read_indices(State& state, const Json& json, const std::string& where, std::size_t vertices, Budget& budget,
                    Cache& cache, std::vector<std::size_t>& list) {
  if (!member(json, "indices")) {
    for (std::size_t v = 0; v < vertices; ++v) list.push_back(v);
    return {};
  }
  const Expected<std::size_t> number = whole_member(state, json, "indices", where);
  if (!number) return number.error();
  const auto values = read_cached(state, *number, budget, cache);
  if (!values) return values.error();
  if ((*values)->cols() != 1) return state.bad(where + ".indices", "are not single numbers");
  for (Eigen::Index k = 0; k < (*values)->rows(); ++k) {
    const double v = (**values)(k, 0);
    if (!(v >= 0 && v < static_cast<double>(vertices)) || std::floor(v) != v)
      return state.bad(where + ".indices", "name vertex " + std::to_string(v) + " of " + std::to_string(vertices));
    list.push_back(static_cast<std::size_t>(v));
  }
  return {};
}

Expected<std::shared_ptr<const Values>> Gatherer::attribute(const Json& json, const std::string& where,
                                                            std::optional<std::size_t> rows) {
  const auto number = whole(json);
  if (!number) return state_.bad(where, "is not the number of an accessor");
  auto values = read_cached(state_, *number, budget_, cache_);
  if (!values) return values.error();
  if (rows && static_cast<std::size_t>((*values)->rows()) != *rows)
    return state_.bad(where, "has another count than POSITION");
  return values;
}

std::size_t Gatherer::column(const std::string& name, std::size_t target, Eigen::Index width) {
  const auto [place, is_new] = columns_.try_emplace({name, target, width}, out_.attributes.size());
  if (!is_new) return place->second;
  const Eigen::Index first = out_.attributes.empty() ? 0 : out_.attributes.back().first + out_.attributes.back().width;
  out_.attributes.push_back({name, target, first, width});
  return place->second;
}

Status Gatherer::morphs(const Json& targets, const std::string& where, std::size_t vertices, Primitive& primitive,
                        std::vector<Loose>& loose) {
  primitive.targets = targets.size();
  for (std::size_t t = 0; t < targets.size(); ++t)
    for (const char* name : {"POSITION", "NORMAL"}) {
      const Json* moved = member(targets[t], name);
      const bool position = name[0] == 'P';
      if (!moved && !position) continue;
      const std::size_t own = column(name, t, 3);
      primitive.attributes.push_back(own);
      if (!moved) continue;
      const std::string there = where + "." + numbered("targets", t) + "." + name;
      const auto values = attribute(*moved, there, vertices);
      if (!values) return values.error();
      if ((*values)->cols() != 3) return state_.bad(there, "is not of three numbers");
      loose.push_back({own, *values});
    }
  return {};
}

Status Gatherer::add(std::size_t mesh, std::size_t number, const Json& json) {
  const std::string where = numbered("meshes", mesh) + "." + numbered("primitives", number);
  const Expected<std::size_t> mode = whole_member(state_, json, "mode", where, 4);
  if (!mode) return mode.error();
  const Json* attributes = member(json, "attributes");
  if (!attributes || !attributes->is_object()) return state_.bad(where, "has no attributes");
  const Json* position = member(*attributes, "POSITION");
  if (*mode < 4 || *mode > 6 || !position) return {};
  const bool has_joints = member(*attributes, "JOINTS_0") && member(*attributes, "WEIGHTS_0");
  if (has_joints != (joints_ > 0)) return {};
  if (const Json* extensions = member(json, "extensions"))
    if (member(*extensions, "KHR_draco_mesh_compression"))
      return state_.unsupported(where, "is compressed with KHR_draco_mesh_compression, which this build does not read",
                                "decompress the file first");
  const auto points = attribute(*position, where + ".POSITION", std::nullopt);
  if (!points) return points.error();
  if ((*points)->cols() != 3) return state_.bad(where + ".POSITION", "is not of three numbers");
  const auto vertices = static_cast<std::size_t>((*points)->rows());
  std::vector<std::size_t> list;
  if (Status status = read_indices(state_, json, where, vertices, budget_, cache_, list); !status) return status;

  // What the vertices carry.
  Primitive primitive;
  primitive.mesh = mesh;
  primitive.number = number;
  std::vector<Loose> loose;
  std::vector<std::pair<std::shared_ptr<const Values>, std::shared_ptr<const Values>>> sets;
  for (const auto& [name, accessor] : attributes->items()) {
    const std::string there = where + "." + name;
    if (name == "POSITION" || name == "TANGENT" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_"))
      continue;
    if (!name.starts_with("TEXCOORD_") && !name.starts_with("COLOR_") && !name.starts_with("_") && name != "NORMAL")
      continue;
    const auto values = attribute(accessor, there, vertices);
    if (!values) return values.error();
    if ((*values)->cols() > 4) continue;
    loose.push_back({column(name, Attribute::no_target, (*values)->cols()), *values});
    primitive.attributes.push_back(loose.back().attribute);
  }
  for (std::size_t set = 0; joints_ > 0; ++set) {
    const Json* joints = member(*attributes, ("JOINTS_" + std::to_string(set)).c_str());
    const Json* shares = member(*attributes, ("WEIGHTS_" + std::to_string(set)).c_str());
    if (!joints || !shares) break;
    const auto a = attribute(*joints, where + ".JOINTS", vertices),
               b = attribute(*shares, where + ".WEIGHTS", vertices);
    if (!a) return a.error();
    if (!b) return b.error();
    if ((*a)->cols() != 4 || (*b)->cols() != 4) return state_.bad(where, "has joints or weights not by four");
    sets.emplace_back(*a, *b);
  }
  if (Status status = morphs(array_of(json, "targets"), where, vertices, primitive, loose); !status) return status;

  // Vertices that triangles use, in their first order.
  const std::size_t width = out_.attributes.empty()
                                ? 0
                                : static_cast<std::size_t>(out_.attributes.back().first + out_.attributes.back().width);
  if (!(*points)->allFinite()) return state_.bad(where + ".POSITION", "has numbers that are not finite");
  std::vector<Index> renumbered(vertices, no_index);
  const auto vertex = [&](std::size_t v) {
    if (renumbered[v] != no_index) return renumbered[v];
    renumbered[v] = static_cast<Index>(positions_.size());
    positions_.push_back((*points)->row(static_cast<Eigen::Index>(v)).transpose());
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
  const std::size_t corners = list.size(), count = triangle_count(*mode, corners);
  if (positions_.size() + std::min(vertices, corners) > 700'000'000U || triangles_.size() + count > 700'000'000U)
    return state_.unsupported(where, "makes the surface larger than 2^31 / 3", "use a smaller file");
  // Every corner and vertex is copied with what it carries: that counts against the limit too.
  const std::size_t copied = std::min(vertices, corners) * (width + 3 + 8 * sets.size()) + corners;
  if (copied > budget_.values)
    return state_.bad(where, "asks for more numbers than the limit of " + std::to_string(state_.limits.values),
                      "use a smaller file or raise the limit");
  budget_.values -= copied;
  for (std::size_t t = 0; t < count; ++t) {
    const std::array<std::size_t, 3> own = triangle_of(*mode, list, t);
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
  if (rows_.size() > budget_.values / wide)
    return state_.bad(out_.surface.label(),
                      "asks for more numbers than the limit of " + std::to_string(state_.limits.values),
                      "use a smaller file or raise the limit");
  budget_.values -= rows_.size() * wide;
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
