// The surfaces of a file: what each is made of, mended, with its rig.
#include <algorithm>
#include <map>

#include "gather.hpp"
#include "io/scan.hpp"
#include "roots.hpp"
#include "select.hpp"

namespace quadrig::gltf {
namespace {

constexpr std::size_t none = Selector::no_skin;

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

/// Skins of the same joints in the same order, with the same bind matrices, move one surface: each mesh is given to the
/// first of them. Skins that need mending stay by themselves.
void join_skins(State& state, const NodeTree& tree, std::vector<std::size_t>& skin_of, Budget& budget) {
  std::vector<std::pair<std::size_t, Skin>> first;
  std::map<std::size_t, std::size_t> stands_for;
  for (std::size_t& skin : skin_of) {
    if (skin == none) continue;
    const auto [place, is_new] = stands_for.try_emplace(skin, skin);
    if (is_new) {
      Expected<Skin> own = read_skin(state, tree, skin, budget);
      if (!own || own->singular_binds > 0 || own->bind_rows > 0 || loose_roots(state, tree, skin) > 0) continue;
      const auto agrees = [&](const std::pair<std::size_t, Skin>& other) {
        if (own->joints != other.second.joints) return false;
        for (std::size_t j = 0; j < own->joints.size(); ++j)
          if (!own->inverse_bind[j].isApprox(other.second.inverse_bind[j], 1e-5)) return false;
        return true;
      };
      const auto known = std::find_if(first.begin(), first.end(), agrees);
      if (known != first.end())
        place->second = known->first;
      else
        first.emplace_back(skin, std::move(*own));
    }
    skin = place->second;
  }
}

double scale_of(const Eigen::Affine3d& transform) {
  const double scale = elementary::cbrt(std::abs(transform.linear().determinant()));
  return std::isfinite(scale) && scale > 0 ? scale : 1;
}

/// Lengths in the scene by lengths in each mesh, by the first node that has it.
std::vector<double> scale_of_meshes(const State& state, const NodeTree& tree) {
  const Json& nodes = array_of(state.json, "nodes");
  const std::vector<Eigen::Affine3d> world = NodeTree::world(tree.nodes, tree.order);
  std::vector<double> scale(array_of(state.json, "meshes").size(), 1.0);
  for (std::size_t i = nodes.size(); i-- > 0;)
    if (const Json* number = member(nodes[i], "mesh"))
      if (const auto mesh = whole(*number); mesh && *mesh < scale.size()) scale[*mesh] = scale_of(world[i]);
  return scale;
}

/// What all surfaces of one request share.
struct Request {
  State& state;
  const PrepareOptions& prepare;
  const GltfClipOptions& clips;
  const NodeTree& tree;
  const std::vector<double>& mesh_scale;  ///< of the first node that has each mesh
  Budget& budget;
  Budget& frames;  ///< of sampled clips
  Cache& cache;
  Context& context;
};

/// Welds and mends what was gathered. \fails as prepare
Status make_mesh(const Request& request, Gathered& one, const VertexWeights* weights, std::optional<Rig>& rig) {
  const std::string where = one.surface.label();
  Expected<Prepared> prepared =
      prepare(PolygonMesh::from_triangles(one.positions, one.triangles), weights, request.prepare, request.context);
  if (!prepared) {
    Error error = prepared.error();
    error.where = request.state.name.string() + ": " + where + (error.where.empty() ? "" : ", " + error.where);
    return error;
  }
  if (request.context.cancelled()) return cancelled_error("gltf");
  one.corner_vertex = corner_vertices(one, *prepared);
  GltfSurface& surface = one.surface;
  for (const Index t : prepared->source_polygon) {
    surface.source_primitive.push_back(one.triangle_primitive[at(t)]);
    surface.source_triangle.push_back(one.triangle_number[at(t)]);
  }
  one.source_triangle = prepared->source_polygon;
  surface.prepared = prepared->report;
  surface.asset.mesh = std::move(prepared->mesh);
  if (weights) rig.emplace().weights = std::move(*prepared->weights);
  return {};
}

/// The chosen primitives of the surface's meshes; meshes without any are taken off its list.
Status add_primitives(const Request& request, Gathered& one, Gatherer& gatherer, const Selector& selector) {
  std::vector<Index> meshes;
  for (const Index m : one.surface.meshes) {
    const Json& mesh = array_of(request.state.json, "meshes")[at(m)];
    const Json& primitives = array_of(mesh, "primitives");
    const std::size_t before = one.primitives.size();
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      if (request.context.cancelled()) return cancelled_error("gltf");
      if (!selector.has(at(m), primitives[p])) continue;
      if (Status status = gatherer.add(at(m), p, primitives[p]); !status) return status;
    }
    if (one.primitives.size() > before) meshes.push_back(m);
  }
  one.surface.meshes = std::move(meshes);
  if (gatherer.lost_tangents)
    request.context.warn("gltf", one.surface.label() + ": tangents without texture coordinates are left out");
  if (request.context.cancelled()) return cancelled_error("gltf");
  return gatherer.finish();
}

/// One surface with its skin, where it has one. \return whether there are triangles
Expected<bool> make_surface(const Request& request, Gathered& one, const Selector& selector) {
  State& state = request.state;
  GltfSurface& surface = one.surface;
  if (surface.skin == no_index) {
    Gatherer gatherer(state, one, 0, request.budget, request.cache);
    const Index mesh = surface.meshes.front();
    if (Status status = add_primitives(request, one, gatherer, selector); !status) return status.error();
    if (one.triangles.rows() == 0) return false;
    surface.world_scale = request.mesh_scale[at(mesh)];
    if (Status status = make_mesh(request, one, nullptr, surface.asset.rig); !status) return status.error();
    return true;
  }
  // Each skin looks at every node, so that counts against the limit too.
  if (Status status = charge(state, request.budget, request.tree.nodes.size(), 16, surface.label()); !status)
    return status.error();
  const Expected<Skin> skin = read_skin(state, request.tree, at(surface.skin), request.budget);
  if (!skin) return skin.error();
  surface.repairs.singular_binds = skin->singular_binds;
  surface.repairs.bind_rows = skin->bind_rows;
  surface.repairs.loose_roots = loose_roots(state, request.tree, at(surface.skin));
  one.inverse_bind = skin->inverse_bind;
  Gatherer gatherer(state, one, one.joints(), request.budget, request.cache);
  if (Status status = add_primitives(request, one, gatherer, selector); !status) return status.error();
  if (one.triangles.rows() == 0) return false;
  if (request.context.cancelled()) return cancelled_error("gltf");
  const VertexWeights weights =
      mend_weights(std::move(gatherer.weights), one.triangles, one.positions, one.joints(), surface.repairs);
  if (request.context.cancelled()) return cancelled_error("gltf");
  const std::vector<std::string> repairs = surface.repairs.sentences();
  if (request.prepare.strict && !repairs.empty())
    return state.bad(surface.label(), repairs.front(), "mend the file, or leave out the strict option");
  for (const std::string& repair : repairs) request.context.warn("gltf", surface.label() + ": " + repair);
  std::optional<Rig> rig;
  if (Status status = make_mesh(request, one, &weights, rig); !status) return status.error();
  surface.world_scale = scale_of(skin->to_mesh.inverse());
  rig->skeleton = bones_of(*skin, surface.asset.mesh, rig->weights);
  for (std::size_t j = 0; j < skin->joints.size(); ++j) {
    const Json* name = member(array_of(state.json, "nodes")[skin->joints[j]], "name");
    rig->skeleton.bones[j].name = name && name->is_string() ? name->get<std::string>() : "joint " + std::to_string(j);
  }
  if (request.clips.enabled) {
    Expected<std::vector<Clip>> clips =
        read_clips(state, request.tree, *skin, request.clips.frames_per_second, request.budget, request.frames);
    if (!clips) return clips.error();
    rig->clips = std::move(*clips);
  }
  surface.asset.rig = std::move(rig);
  return true;
}

/// The surfaces that there could be: each skin with its meshes, then each mesh that no skin moves.
std::vector<Gathered> candidates(const State& state, const std::vector<std::size_t>& skin_of,
                                 const Selector& selector) {
  std::vector<Gathered> all;
  const Json& meshes = array_of(state.json, "meshes");
  const Json& skins = array_of(state.json, "skins");
  const auto name_of = [](const Json& json) {
    const Json* name = member(json, "name");
    return name && name->is_string() ? name->get<std::string>() : std::string();
  };
  const auto chosen = [&](std::size_t m) {
    for (const Json& primitive : array_of(meshes[m], "primitives"))
      if (selector.has(m, primitive)) return true;
    return false;
  };
  std::vector<Index> of_skin(skins.size(), no_index);
  std::vector<Gathered> unskinned;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    if (!chosen(m)) continue;
    Gathered* one = nullptr;
    if (skin_of[m] == none) {
      one = &unskinned.emplace_back();
    } else if (Index& known = of_skin[skin_of[m]]; known == no_index) {
      known = static_cast<Index>(all.size());
      one = &all.emplace_back();
      one->surface.skin = static_cast<Index>(skin_of[m]);
      one->surface.name = name_of(skins[skin_of[m]]);
    } else {
      one = &all[at(known)];
    }
    if (one->surface.name.empty()) one->surface.name = name_of(meshes[m]);
    one->surface.meshes.push_back(static_cast<Index>(m));
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Gathered& a, const Gathered& b) { return a.surface.skin < b.surface.skin; });
  for (Gathered& one : unskinned) all.push_back(std::move(one));
  return all;
}

}  // namespace

Expected<std::vector<Gathered>> gather(State& state, const PrepareOptions& prepare_options,
                                       const GltfClipOptions& clip_options, const GltfSelection& selection,
                                       Context& context) {
  Expected<std::vector<std::size_t>> skin_of = skins_of_meshes(state);
  if (!skin_of) return skin_of.error();
  const Expected<NodeTree> tree = NodeTree::read(state);
  if (!tree) return tree.error();
  const Expected<Selector> selector = Selector::create(state, selection, *skin_of);
  if (!selector) return selector.error();
  Budget budget, frames{.spare = 3 * Budget{}.spare};  // a long clip may have few keys
  join_skins(state, *tree, *skin_of, budget);
  Cache cache;
  const std::vector<double> mesh_scale = scale_of_meshes(state, *tree);
  const Request request{state, prepare_options, clip_options, *tree, mesh_scale, budget, frames, cache, context};
  std::vector<Gathered> all;
  bool any = false;
  for (Gathered& one : candidates(state, *skin_of, *selector)) {
    const Expected<bool> made = make_surface(request, one, *selector);
    if (!made && (made.error().code == ErrorCode::cancelled || prepare_options.strict)) return made.error();
    if (made && !*made) continue;
    if (!made) {
      Gathered failed;
      failed.surface.skin = one.surface.skin;
      failed.surface.name = one.surface.name;
      failed.surface.meshes = one.surface.meshes;
      failed.failure = made.error();
      one = std::move(failed);
    }
    any = any || made;
    all.push_back(std::move(one));
  }
  if (all.empty())
    return state.bad("meshes", "there are no triangles to remesh",
                     "give a file with triangles, select others, or take unskinned meshes too");
  if (!any) return *all.front().failure;
  return all;
}

}  // namespace quadrig::gltf

namespace quadrig {

std::string GltfSurface::label() const {
  const std::string place = skin != no_index  ? gltf::numbered("skins", gltf::at(skin))
                            : !meshes.empty() ? gltf::numbered("meshes", gltf::at(meshes.front()))
                                              : "meshes";
  return name.empty() ? place : place + " " + io::shown(name);
}

Expected<std::vector<GltfSurface>> gltf_surfaces(const GltfDocument& document, const PrepareOptions& prepare_options,
                                                 const GltfClipOptions& clips, Context& context,
                                                 const GltfSelection& selection) {
  if (Status status = prepare_options.validate(); !status) return status.error();
  Expected<std::vector<gltf::Gathered>> gathered =
      gltf::gather(document.state(), prepare_options, clips, selection, context);
  if (!gathered) return gathered.error();
  std::vector<GltfSurface> surfaces;
  for (gltf::Gathered& one : *gathered) {
    if (one.failure) return *one.failure;
    surfaces.push_back(std::move(one.surface));
  }
  return surfaces;
}

}  // namespace quadrig
