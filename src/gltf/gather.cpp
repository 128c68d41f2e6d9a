// Primitives of a skin into one surface.
#include "gather.hpp"

namespace quadrig::gltf {
namespace {

constexpr std::size_t none = static_cast<std::size_t>(-1);

/// Skin of each mesh: that of the first node that has both.
Expected<std::vector<std::size_t>> skins_of_meshes(const State& state) {
  std::vector<std::size_t> skin_of(array_of(state.json, "meshes").size(), none);
  const Json& nodes = array_of(state.json, "nodes");
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!member(nodes[i], "mesh") || !member(nodes[i], "skin")) continue;
    const std::string where = numbered("nodes", i);
    const Expected<std::size_t> mesh = whole_member(state, nodes[i], "mesh", where);
    if (!mesh) return mesh.error();
    const Expected<std::size_t> skin = whole_member(state, nodes[i], "skin", where);
    if (!skin) return skin.error();
    if (*mesh >= skin_of.size()) return state.bad(where + ".mesh", "is not there");
    if (*skin >= array_of(state.json, "skins").size()) return state.bad(where + ".skin", "is not there");
    if (skin_of[*mesh] == none) skin_of[*mesh] = *skin;
  }
  return skin_of;
}

/// Reads one skin's primitives one after another.
class Gatherer {
 public:
  Gatherer(State& state, Gathered& out, Index joints, Budget& budget, Cache& cache)
      : state_(state), out_(out), joints_(joints), budget_(budget), cache_(cache) {}

  Status add(std::size_t mesh, std::size_t number, const Json& json);
  void finish();
  RawWeights weights;

 private:
  struct Loose {
    std::size_t attribute;
    std::shared_ptr<const Values> values;
  };
  Status indices(const Json& json, const std::string& where, std::size_t vertices, std::vector<std::size_t>& list);
  Expected<std::shared_ptr<const Values>> attribute(const Json& json, const std::string& where, std::size_t rows);
  std::size_t column(const std::string& name, std::size_t target, Eigen::Index width);

  State& state_;
  Gathered& out_;
  Index joints_;
  Budget& budget_;
  Cache& cache_;
  std::vector<Vector3> positions_;
  std::vector<std::array<Index, 3>> triangles_;
  std::vector<std::vector<double>> rows_;  // values of each vertex: as many columns as were known when it was added
};

Expected<std::shared_ptr<const Values>> Gatherer::attribute(const Json& json, const std::string& where,
                                                            std::size_t rows) {
  const auto number = whole(json);
  if (!number) return state_.bad(where, "is not the number of an accessor");
  auto values = read_cached(state_, *number, budget_, cache_);
  if (!values) return values.error();
  if (rows != none && static_cast<std::size_t>((*values)->rows()) != rows)
    return state_.bad(where, "has another count than POSITION");
  return values;
}

std::size_t Gatherer::column(const std::string& name, std::size_t target, Eigen::Index width) {
  Eigen::Index first = 0;
  for (std::size_t i = 0; i < out_.attributes.size(); ++i) {
    const Attribute& known = out_.attributes[i];
    if (known.name == name && known.target == target && known.width == width) return i;
    first = known.first + known.width;
  }
  out_.attributes.push_back({name, target, first, width});
  return out_.attributes.size() - 1;
}

Status Gatherer::indices(const Json& json, const std::string& where, std::size_t vertices,
                         std::vector<std::size_t>& list) {
  if (!member(json, "indices")) {
    for (std::size_t v = 0; v < vertices; ++v) list.push_back(v);
    return {};
  }
  const Expected<std::size_t> number = whole_member(state_, json, "indices", where);
  if (!number) return number.error();
  const auto values = read_cached(state_, *number, budget_, cache_);
  if (!values) return values.error();
  if ((*values)->cols() != 1) return state_.bad(where + ".indices", "are not single numbers");
  for (Eigen::Index k = 0; k < (*values)->rows(); ++k) {
    const double v = (**values)(k, 0);
    if (!(v >= 0 && v < static_cast<double>(vertices)) || std::floor(v) != v)
      return state_.bad(where + ".indices", "name vertex " + std::to_string(v) + " of " + std::to_string(vertices));
    list.push_back(static_cast<std::size_t>(v));
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
  if (*mode < 4 || *mode > 6 || !position || !member(*attributes, "JOINTS_0") || !member(*attributes, "WEIGHTS_0"))
    return {};
  if (const Json* extensions = member(json, "extensions"))
    if (member(*extensions, "KHR_draco_mesh_compression"))
      return state_.unsupported(where, "is compressed with KHR_draco_mesh_compression, which this build does not read",
                                "decompress the file first");
  const auto points = attribute(*position, where + ".POSITION", none);
  if (!points) return points.error();
  if ((*points)->cols() != 3) return state_.bad(where + ".POSITION", "is not of three numbers");
  const auto vertices = static_cast<std::size_t>((*points)->rows());
  std::vector<std::size_t> list;
  if (Status status = indices(json, where, vertices, list); !status) return status;

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
  for (std::size_t set = 0;; ++set) {
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
  const Json& targets = array_of(json, "targets");
  primitive.targets = targets.size();
  for (std::size_t t = 0; t < targets.size(); ++t) {
    const std::size_t own = column("POSITION", t, 3);
    primitive.attributes.push_back(own);
    const Json* moved = member(targets[t], "POSITION");
    if (!moved) continue;
    const auto values = attribute(*moved, where + "." + numbered("targets", t), vertices);
    if (!values) return values.error();
    if ((*values)->cols() != 3) return state_.bad(where + "." + numbered("targets", t), "is not of three numbers");
    loose.push_back({own, *values});
  }

  // Vertices that triangles use, in their first order.
  std::size_t width = 0;
  for (const Attribute& a : out_.attributes) width = static_cast<std::size_t>(a.first + a.width);
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
  const std::size_t corners = list.size(), count = *mode == 4 ? corners / 3 : corners < 3 ? 0 : corners - 2;
  if (positions_.size() + std::min(vertices, corners) > 700'000'000U || triangles_.size() + count > 700'000'000U)
    return state_.unsupported(where, "makes the surface larger than 2^31 / 3", "use a smaller file");
  // Every vertex is copied with what it carries: that counts against the limit too.
  const std::size_t copied = std::min(vertices, corners) * (width + 3 + 8 * sets.size());
  if (copied > budget_.values)
    return state_.bad(where, "asks for more numbers than the limit of " + std::to_string(state_.limits.values),
                      "use a smaller file or raise the limit");
  budget_.values -= copied;
  for (std::size_t t = 0; t < count; ++t) {
    std::array<std::size_t, 3> own{};
    if (*mode == 4)
      own = {list[3 * t], list[3 * t + 1], list[3 * t + 2]};
    else if (*mode == 5)
      own = t % 2 == 0 ? std::array{list[t], list[t + 1], list[t + 2]} : std::array{list[t + 1], list[t], list[t + 2]};
    else
      own = {list[0], list[t + 1], list[t + 2]};
    const Index a = vertex(own[0]), b = vertex(own[1]), c = vertex(own[2]);
    triangles_.push_back({a, b, c});
    out_.triangle_primitive.push_back(static_cast<Index>(out_.primitives.size()));
    out_.triangle_number.push_back(static_cast<Index>(t));
  }
  out_.primitives.push_back(std::move(primitive));
  return {};
}

void Gatherer::finish() {
  Eigen::Index width = 0;
  for (const Attribute& a : out_.attributes) width = a.first + a.width;
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
}

/// The gathered vertex of each corner: of the triangle that the face is part of, the vertex at the same place; of
/// faces whose edge was flipped, any that stood at that place.
std::vector<Index> corner_vertices(const Gathered& gathered, const Prepared& prepared) {
  const TriangleMesh<double>& mesh = prepared.mesh;
  std::vector<Index> result;
  result.reserve(at(mesh.halfedge_count()));
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const Index t = prepared.source_polygon[at(f)];
    for (int i = 0; i < 3; ++i) {
      const Index v = mesh.faces()(f, i);
      Index found = prepared.source_vertex[at(v)];
      double nearest = std::numeric_limits<double>::infinity();
      for (int k = 0; k < 3; ++k) {
        const Index candidate = gathered.triangles(t, k);
        const double distance = (gathered.positions.row(candidate) - mesh.positions().row(v)).squaredNorm();
        const double allowed =
            (gathered.positions.row(prepared.source_vertex[at(v)]) - mesh.positions().row(v)).squaredNorm();
        if (distance < nearest && distance <= std::max(allowed, 1e-20)) nearest = distance, found = candidate;
      }
      result.push_back(found);
    }
  }
  return result;
}

}  // namespace

Expected<std::vector<Gathered>> gather(State& state, const PrepareOptions& prepare_options,
                                       const GltfClipOptions& clip_options, Context& context) {
  const Expected<std::vector<std::size_t>> skin_of = skins_of_meshes(state);
  if (!skin_of) return skin_of.error();
  const Expected<NodeTree> tree = NodeTree::read(state);
  if (!tree) return tree.error();
  Budget budget{state.limits.values};
  Cache cache;
  std::vector<Gathered> all;
  const std::size_t skins = array_of(state.json, "skins").size();
  for (std::size_t s = 0; s < skins; ++s) {
    Gathered one;
    one.surface.skin = static_cast<Index>(s);
    bool used = false;
    for (const std::size_t skin : *skin_of) used = used || skin == s;
    if (!used) continue;
    const Expected<Skin> skin = read_skin(state, *tree, s, budget);
    if (!skin) return skin.error();
    const auto joints = static_cast<Index>(skin->joints.size());
    one.surface.name = skin->name;
    one.surface.repairs.singular_binds = skin->singular_binds;
    one.surface.repairs.bind_rows = skin->bind_rows;
    one.inverse_bind = skin->inverse_bind;
    Gatherer gatherer(state, one, joints, budget, cache);
    for (std::size_t m = 0; m < skin_of->size(); ++m) {
      if ((*skin_of)[m] != s) continue;
      const Json& mesh = array_of(state.json, "meshes")[m];
      const Json& primitives = array_of(mesh, "primitives");
      const std::size_t before = one.primitives.size();
      for (std::size_t p = 0; p < primitives.size(); ++p) {
        if (context.cancelled()) return cancelled_error("gltf");
        if (Status status = gatherer.add(m, p, primitives[p]); !status) return status.error();
      }
      if (one.primitives.size() == before) continue;
      one.surface.meshes.push_back(static_cast<Index>(m));
      if (const Json* name = member(mesh, "name"); one.surface.name.empty() && name && name->is_string())
        one.surface.name = name->get<std::string>();
    }
    gatherer.finish();
    if (one.triangles.rows() == 0) continue;
    const VertexWeights weights =
        mend_weights(std::move(gatherer.weights), one.triangles, one.positions, joints, one.surface.repairs);
    const std::string where = numbered("skins", s);
    const std::vector<std::string> repairs = one.surface.repairs.sentences();
    if (prepare_options.strict && !repairs.empty())
      return state.bad(where, repairs.front(), "mend the file, or leave out the strict option");
    for (const std::string& repair : repairs) context.warn("gltf", where + ": " + repair);
    Expected<Prepared> prepared =
        prepare(PolygonMesh::from_triangles(one.positions, one.triangles), &weights, prepare_options, context);
    if (!prepared) {
      Error error = prepared.error();
      error.where = state.name.string() + ": " + where + (error.where.empty() ? "" : ", " + error.where);
      return error;
    }
    one.corner_vertex = corner_vertices(one, *prepared);
    GltfSurface& surface = one.surface;
    for (const Index t : prepared->source_polygon) {
      surface.source_primitive.push_back(one.triangle_primitive[at(t)]);
      surface.source_triangle.push_back(one.triangle_number[at(t)]);
    }
    surface.prepared = prepared->report;
    surface.world_scale = std::cbrt(std::abs(skin->to_mesh.inverse().linear().determinant()));
    if (!std::isfinite(surface.world_scale) || !(surface.world_scale > 0)) surface.world_scale = 1;
    surface.asset.mesh = std::move(prepared->mesh);
    Rig rig;
    rig.weights = std::move(*prepared->weights);
    rig.skeleton = bones_of(*skin, surface.asset.mesh, rig.weights);
    for (std::size_t j = 0; j < skin->joints.size(); ++j) {
      const Json* name = member(array_of(state.json, "nodes")[skin->joints[j]], "name");
      rig.skeleton.bones[j].name = name && name->is_string() ? name->get<std::string>() : "joint " + std::to_string(j);
    }
    if (clip_options.enabled) {
      Expected<std::vector<Clip>> clips = read_clips(state, *tree, *skin, clip_options.frames_per_second, budget);
      if (!clips) return clips.error();
      rig.clips = std::move(*clips);
    }
    surface.asset.rig = std::move(rig);
    all.push_back(std::move(one));
  }
  if (all.empty())
    return state.bad("meshes", "no skin moves triangles: there is no rigged surface",
                     "give a file with a skinned mesh");
  return all;
}

}  // namespace quadrig::gltf

namespace quadrig {

Expected<std::vector<GltfSurface>> gltf_surfaces(const GltfDocument& document, const PrepareOptions& prepare_options,
                                                 const GltfClipOptions& clips, Context& context) {
  if (Status status = prepare_options.validate(); !status) return status.error();
  Expected<std::vector<gltf::Gathered>> gathered = gltf::gather(document.state(), prepare_options, clips, context);
  if (!gathered) return gathered.error();
  std::vector<GltfSurface> surfaces;
  for (gltf::Gathered& one : *gathered) surfaces.push_back(std::move(one.surface));
  return surfaces;
}

}  // namespace quadrig
