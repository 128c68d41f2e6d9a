// Surfaces into quads, and back into their file.
#include <algorithm>
#include <map>
#include <numeric>

#include "assemble.hpp"
#include "distances.hpp"
#include "layers.hpp"
#include "normals.hpp"
#include "roots.hpp"

namespace quadrig {
namespace gltf {
namespace {

/// Quads of a field put behind those of other shells; `source` refers to the surface then.
void append(RemeshResult& all, const FieldQuads& field) {
  const Index vertices = all.mesh.vertex_count(), quads = all.mesh.quad_count();
  const QuadMesh& own = field.result.mesh;
  all.mesh.positions.conservativeResize(vertices + own.vertex_count(), 3);
  all.mesh.positions.bottomRows(own.vertex_count()) = own.positions;
  all.mesh.quads.conservativeResize(quads + own.quad_count(), 4);
  all.mesh.quads.bottomRows(own.quad_count()) = own.quads.array() + vertices;
  // Of those that have none all are given, as long as any shell has one.
  const std::vector<Index>& twin = field.result.twin;
  if (!twin.empty() || !all.twin.empty()) {
    all.twin.resize(at(vertices), no_index);
    for (Index v = 0; v < own.vertex_count(); ++v)
      all.twin.push_back(twin.empty() || twin[at(v)] == no_index ? no_index : vertices + twin[at(v)]);
  }
  for (const SurfacePoint& point : own.source)
    all.mesh.source.push_back({field.faces[at(point.face)], point.barycentric});
  all.morphs.resize(field.result.morphs.size());
  for (std::size_t k = 0; k < all.morphs.size(); ++k) {
    all.morphs[k].conservativeResize(vertices + own.vertex_count(), 3);
    all.morphs[k].bottomRows(own.vertex_count()) = field.result.morphs[k];
  }
  const RemeshReport& report = field.result.report;
  if (all.report.components.empty() || report.quads > all.report.quads) {
    all.report.field = report.field;
    all.report.backends = report.backends;
  }
  all.report.quads += report.quads;
  all.report.irregular += report.irregular;
  all.report.fit += report.fit;
  all.report.symmetry += report.symmetry;
  all.report.components.insert(all.report.components.end(), report.components.begin(), report.components.end());
  all.report.warnings.insert(all.report.warnings.end(), report.warnings.begin(), report.warnings.end());
  all.report.seconds += report.seconds;
  all.report.rims.insert(all.report.rims.end(), report.rims.begin(), report.rims.end());
}

/// The quads among polygons of the surface's own vertices, likewise.
void append(RemeshResult& all, const TriangleMesh<double>& mesh, const std::vector<Polygon>& polygons) {
  std::map<Index, Index> number;
  const Index vertices = all.mesh.vertex_count();
  std::vector<std::array<Index, 4>> quads;
  for (const Polygon& p : polygons) {
    if (p.size() != 4) continue;
    std::array<Index, 4>& quad = quads.emplace_back();
    for (std::size_t i = 0; i < 4; ++i) {
      const auto [place, is_new] = number.try_emplace(p.vertex[i], vertices + static_cast<Index>(number.size()));
      quad[i] = place->second;
      if (!is_new) continue;
      const Index h = mesh.outgoing(p.vertex[i]);
      all.mesh.source.push_back({h / 3, Vector3::Unit(h % 3)});
    }
  }
  all.mesh.positions.conservativeResize(vertices + static_cast<Eigen::Index>(number.size()), 3);
  for (const auto& [v, n] : number) all.mesh.positions.row(n) = mesh.positions().row(v);
  const Eigen::Index first = all.mesh.quads.rows();
  all.mesh.quads.conservativeResize(first + static_cast<Eigen::Index>(quads.size()), 4);
  for (std::size_t q = 0; q < quads.size(); ++q)
    for (std::size_t i = 0; i < 4; ++i)
      all.mesh.quads(first + static_cast<Eigen::Index>(q), static_cast<Eigen::Index>(i)) = quads[q][i];
  Index irregular = 0;
  static_cast<void>(irregular_share(polygons, irregular));
  all.report.irregular += irregular;
  all.report.quads += static_cast<Index>(quads.size());
}

/// Weights of all vertices of the quads: those of their places on the surface, but for a field's, which are given.
void set_weights(RemeshResult& all, const Asset& asset, const std::vector<const SkinWeights*>& fields) {
  if (!asset.rig) return;
  std::vector<Eigen::Triplet<double, Index>> entries;
  Index row = 0;
  for (const SkinWeights* own : fields) {
    for (Index v = 0; v < own->rows(); ++v)
      for (SkinWeights::InnerIterator it(*own, v); it; ++it)
        entries.emplace_back(row + v, static_cast<Index>(it.col()), it.value());
    row += static_cast<Index>(own->rows());
  }
  const std::span<const SurfacePoint> rest = std::span(all.mesh.source).subspan(at(row));
  const SkinWeights others = interpolate(asset.mesh, asset.rig->weights, rest);
  for (Index v = 0; v < others.rows(); ++v)
    for (SkinWeights::InnerIterator it(others, v); it; ++it)
      entries.emplace_back(row + v, static_cast<Index>(it.col()), it.value());
  all.weights.emplace(all.mesh.vertex_count(), static_cast<Index>(asset.rig->weights.cols()));
  all.weights->setFromTriplets(entries.begin(), entries.end());
}

/// What came of all shells of a surface, in one result.
void collect(Job& job, const Shells& shells, GltfRemeshed& done, GltfNormals normals, Index influences) {
  const Asset& asset = job.gathered.surface.asset;
  RemeshResult& result = done.result;
  std::vector<const SkinWeights*> weights;
  std::map<Index, Index> claims;
  result.mesh.positions.resize(0, 3);
  result.mesh.quads.resize(0, 4);
  for (const Shell& shell : shells.list) {
    if (!shell.field) continue;
    for (const auto& [quad, face] : shell.field->claims)
      claims[result.mesh.quad_count() + quad] = shell.field->faces[at(face)];
    append(result, *shell.field);
    if (shell.field->result.weights) weights.push_back(&*shell.field->result.weights);
    done.seam_edges += shell.field->seam_edges;
    done.snapped_edges += shell.field->snapped_edges;
  }
  if (asset.rig) set_weights(result, asset, weights);
  std::vector<char> keep_normals(shells.list.size(), normals == GltfNormals::keep);
  if (normals == GltfNormals::automatic)
    keep_normals = authored_normals(job.gathered, *shells.wedges, shells.components);
  for (std::size_t s = 0; s < shells.list.size(); ++s) done.kept_normals += shells.list[s].field && keep_normals[s];
  add_field(job, shells, result, claims, keep_normals, influences);
  for (const bool quads : {true, false})
    for (const Shell& shell : shells.list)
      if (!shell.field) add_polygons(job, shells, shell, quads, normals, influences);
  for (const Shell& shell : shells.list) {
    if (!shell.field) append(result, asset.mesh, shell.polygons);
    GltfShell& told = done.shells.emplace_back();
    told.part = shell_label(job.gathered, shells, shell);
    told.make = shell.make;
    told.input_triangles = shell.own();
    told.due = shell.due;
    for (const Polygon& p : shell.polygons) told.quads += p.size() == 4;
    if (shell.field) told.quads = shell.field->result.mesh.quad_count();
    told.triangles = shell.triangles() - 2 * told.quads;
    told.rms = shell.apart.rms;
    told.mean = shell.apart.mean;
    told.largest = shell.apart.largest;
    told.largest_unbent = shell.apart.largest_unbent;
    told.edge = std::sqrt(2 * shell.area(asset.mesh) / std::max<Index>(1, shell.triangles()));
    done.triangles += told.triangles;
    if (told.quads > 0) continue;
    ++done.passed_shells;
    done.passed_triangles += told.triangles;
  }
  if (asset.rig) set_weights(result, asset, weights);
  if (!result.twin.empty()) result.twin.resize(at(result.mesh.vertex_count()), no_index);
  RemeshReport& report = result.report;
  report.vertices = result.mesh.vertex_count();
  report.scaled_jacobian_minimum = 1;
  for (Index q = 0; q < result.mesh.quad_count(); ++q) {
    const double jacobian = scaled_jacobian(result.mesh.positions, result.mesh.quads.row(q));
    report.scaled_jacobian_average += jacobian / result.mesh.quad_count();
    report.scaled_jacobian_minimum = std::min(report.scaled_jacobian_minimum, jacobian);
  }
  done.remeshed = asset.mesh;
}

/// The primitives of the surface's meshes, replaced. One of which nothing could be read stays as it is.
void write_back(State& state, const Job& job, GltfRemeshed& done, bool source_map) {
  const Gathered& gathered = job.gathered;
  for (const Index m : gathered.surface.meshes) {
    Json& primitives = state.json["meshes"][at(m)]["primitives"];
    std::vector<std::size_t> builder_of(primitives.size(), static_cast<std::size_t>(-1));
    for (std::size_t p = 0; p < gathered.primitives.size(); ++p)
      if (gathered.primitives[p].mesh == at(m) && !job.builders[p].empty())
        builder_of[gathered.primitives[p].number] = p;
    LocalJson kept = Json::array();
    for (std::size_t k = 0; k < builder_of.size(); ++k) {
      if (builder_of[k] == static_cast<std::size_t>(-1)) {
        kept.push_back(primitives[k]);
        continue;
      }
      const PrimitiveBuilder& builder = job.builders[builder_of[k]];
      const LocalJson old = Json(primitives[k]);
      kept.push_back(builder.write(state, old, gathered, gathered.primitives[builder_of[k]], source_map));
      done.written_vertices += builder.vertex_count();
      ++done.written_primitives;
    }
    replace(state.json["meshes"][at(m)]["primitives"], std::move(kept));
    state.edited = true;
  }
}

/// Names quadrig before what made the file, once.
void sign(State& state) {
  constexpr std::string_view name = "quadrig " QUADRIG_VERSION;
  Json& asset = state.json["asset"];
  if (!asset.is_object()) return;
  Json& generator = asset["generator"];
  const std::string before = generator.is_string() ? generator.get<std::string>() : std::string();
  if (!before.starts_with("quadrig ")) generator = std::string(name) + (before.empty() ? "" : "; " + before);
}

/// Takes an extension of primitives off the lists of the file where no primitive has it any more.
void drop_unused_extension(State& state, const char* name) {
  for (const Json& mesh : array_of(state.json, "meshes"))
    for (const Json& primitive : array_of(mesh, "primitives"))
      if (const Json* extensions = member(primitive, "extensions"); extensions && member(*extensions, name)) return;
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    if (array_of(state.json, list).empty()) continue;
    LocalJson kept = Json::array();
    for (const Json& one : state.json[list])
      if (one != name) kept.push_back(one);
    if (kept.empty()) {
      dismantle(state.json[list]);
      state.json.erase(list);
    } else {
      replace(state.json[list], std::move(kept));
    }
  }
}

/// Numbers of a surface's primitives, counted over all meshes of the file.
/// \fails unsupported where a float cannot hold the number of a triangle
Status number_primitives(const State& state, Job& job) {
  const Json& meshes = array_of(state.json, "meshes");
  std::vector<std::size_t> before(1, 0);
  for (const Json& mesh : meshes) before.push_back(before.back() + array_of(mesh, "primitives").size());
  for (const Primitive& primitive : job.gathered.primitives)
    job.primitive_number.push_back(static_cast<Index>(before[primitive.mesh] + primitive.number));
  constexpr Index most = 1 << 24;
  for (const Index number : job.gathered.triangle_number)
    if (number >= most || before.back() >= at(most))
      return state.unsupported(job.gathered.surface.label(), "has more than 2^24 triangles in a primitive",
                               "leave out the source map");
  return {};
}

}  // namespace
}  // namespace gltf

Expected<std::vector<GltfRemeshed>> remesh_gltf(GltfDocument& document, const GltfRemeshOptions& options,
                                                Context& context) {
  using gltf::at;
  if (Status status = options.remesh.validate(); !status) return status.error();
  if (Status status = options.prepare.validate(); !status) return status.error();
  if (options.most_poses < 1) return Error{ErrorCode::bad_option, "needs at least one", "most_poses", "give 1 or more"};
  GltfClipOptions clips;
  clips.enabled = options.pose_source == GltfPoses::clips || options.clip_directions;
  gltf::State& state = document.state();
  SpanTimer gathering(context, "surfaces");
  Expected<std::vector<gltf::Gathered>> gathered =
      gltf::gather(state, options.prepare, clips, options.selection, context);
  gathering.end();
  if (!gathered) return gathered.error();
  if (std::ranges::none_of(*gathered, [](const gltf::Gathered& one) { return one.surface.asset.rig.has_value(); })) {
    if (options.remesh.group_borders)
      return Error{ErrorCode::bad_option, "vertex groups are the columns of skin weights", "group_borders",
                   "give a file with a skin"};
    if (options.remesh.preset == FieldPreset::thesis)
      return Error{ErrorCode::bad_option, "the thesis preset needs a rig", "preset", "use the static one"};
  }
  const auto has_clips = [](const gltf::Gathered& one) {
    return one.surface.asset.rig && !one.surface.asset.rig->clips.empty();
  };
  if (options.clip_directions && std::ranges::none_of(*gathered, has_clips))
    return Error{ErrorCode::bad_option, "directions are asked of clips, and no clip moves a surface", "clip_directions",
                 "take them at rest (--directions rest)"};
  if (options.pose_source == GltfPoses::clips || options.clip_directions ||
      options.remesh.preset == FieldPreset::thesis || options.remesh.group_borders)
    for (const gltf::Gathered& one : *gathered) {
      if (one.failure) continue;
      const auto tell = [&](const std::string& text) { context.warn("gltf", one.surface.label() + ": " + text); };
      const std::optional<Rig>& rig = one.surface.asset.rig;
      if (!rig && options.remesh.preset == FieldPreset::thesis)
        tell("has no rig, which the thesis preset needs: made by the static one");
      if (!rig && options.remesh.group_borders) tell("has no rig, so no borders of vertex groups are kept");
      if (rig && options.pose_source == GltfPoses::clips && rig->clips.empty())
        tell("has no clips: every joint is bent instead");
      if (rig && options.clip_directions && rig->clips.empty()) tell("has no clips: directions are those at rest");
    }
  if (Status status = gltf::check_density(*gathered, options); !status) return status.error();
  context.progress("shares", 0);
  SpanTimer sharing(context, "shares");
  if (context.cancelled()) return cancelled_error("gltf");
  std::vector<gltf::Shells> shells;
  double work = 0, begun = 0;
  for (const gltf::Gathered& one : *gathered) {
    if (one.failure) {
      shells.emplace_back();
      continue;
    }
    Expected<gltf::Shells> found = gltf::find_shells(one, options, context);
    if (!found) return found.error();
    shells.push_back(std::move(*found));
  }
  gltf::share_out(shells, 2.0 * options.remesh.quads, options);
  for (std::size_t s = 0; s < shells.size(); ++s) gltf::join_twins((*gathered)[s], shells[s], options, context);
  sharing.end();
  if (context.cancelled()) return cancelled_error("gltf");
  for (const gltf::Shells& one : shells)
    for (const gltf::Shell& shell : one.list) work += shell.due;

  std::vector<GltfRemeshed> all;
  std::vector<gltf::Job> jobs;
  const Error* failed = nullptr;
  bool any = false;
  gltf::Budget carried;
  for (std::size_t s = 0; s < gathered->size(); ++s) {
    gltf::Job job;
    job.gathered = std::move((*gathered)[s]);
    job.builders.resize(job.gathered.primitives.size());
    if (Status status = gltf::number_primitives(state, job); !status && options.source_map) return status.error();
    GltfRemeshed done;
    if (job.gathered.failure) {
      done.failures.push_back({job.gathered.surface.label(), *job.gathered.failure});
    } else {
      // Each vertex that is written carries all columns, some times over: how many quads is the caller's choice, how
      // many columns beyond what any surface has is the file's.
      constexpr std::size_t usual_columns = 64;
      const auto columns =
          std::max(static_cast<std::size_t>(job.gathered.values.cols()), usual_columns) - usual_columns;
      double quads = 0;
      for (const gltf::Shell& shell : shells[s].list) quads += shell.due / 2;
      if (Status status = gltf::charge(state, carried, static_cast<std::size_t>(4 * quads), columns,
                                       job.gathered.surface.label() + ": what the vertices of the quads carry");
          !status)
        return status.error();
      context.log(job.gathered.surface.label());
      shells[s].wedges.emplace(job.gathered, shells[s].components);  // refers to what has moved
      for (gltf::Shell& shell : shells[s].list) {
        const ProgressPart progress(context, begun / work, (begun + shell.due) / work);
        begun += shell.due;
        context.progress("shells", 0);
        if (context.cancelled()) return cancelled_error("gltf");
        if (Status status = gltf::make_shell(job.gathered, shells[s], shell, options, context); !status)
          return status.error();
        if (shell.failure) done.failures.push_back({gltf::shell_label(job.gathered, shells[s], shell), *shell.failure});
      }
      if (context.cancelled()) return cancelled_error("gltf");
      SpanTimer layers(context, "layers");
      done.moved_vertices = gltf::keep_layers(job.gathered, shells[s], context);
      layers.end();
      SpanTimer assembly(context, "assembly");
      gltf::collect(job, shells[s], done, options.normals, options.remesh.influences);
      if (done.result.weights)
        if (const std::optional<std::string> lacking =
                report_hinges(done.result.mesh, job.gathered.surface.asset.rig->skeleton, *done.result.weights,
                              options.remesh, done.result.report))
          context.warn("gltf", job.gathered.surface.label() + ": " + *lacking);
      if (const std::optional<std::string> lacking = lacking_rings(done.result.report.rims))
        context.warn("gltf", job.gathered.surface.label() + ": " + *lacking);
      for (std::size_t p = 0; p < job.builders.size(); ++p)
        if (job.gathered.primitives[p].tangents)
          job.builders[p].make_tangents(job.gathered, job.gathered.primitives[p]);
      assembly.end();
      const SpanTimer measuring(context, "distances");
      Expected<std::vector<GltfPrimitive>> distances = gltf::primitive_distances(state, job, context);
      if (!distances) return distances.error();
      done.primitives = std::move(*distances);
      if (context.cancelled()) return cancelled_error("gltf");
      any = any || done.result.report.quads > 0;
    }
    all.push_back(std::move(done));
    jobs.push_back(std::move(job));
  }
  for (std::size_t s = all.size(); s-- > 0;)
    if (!all[s].failures.empty()) failed = &all[s].failures.front().reason;
  if (!any && failed) return *failed;
  for (const GltfRemeshed& done : all)
    for (const GltfFailure& failure : done.failures)
      context.warn("gltf", failure.part + " stays as it is: " + failure.reason.message());

  for (std::size_t s = 0; s < all.size(); ++s)
    for (std::size_t c = 0; c < all[s].shells.size(); ++c) {
      const GltfShell& told = all[s].shells[c];
      if (!(options.most_edges_off > 0 && told.largest_unbent > options.most_edges_off * told.edge)) continue;
      ++all[s].strayed;
      char far[32];
      std::snprintf(far, sizeof far, "%.1f", told.largest_unbent / told.edge);
      context.warn("gltf", told.part + " strays " + far +
                               " edges of its quads from the input; ask for more quads, or allow it by max-error");
    }
  Index written = 0;
  for (const GltfRemeshed& done : all) written += 2 * done.result.report.quads + done.triangles;
  if (std::abs(written - 2.0 * options.remesh.quads) > 2 * options.remesh.count_tolerance * options.remesh.quads)
    context.warn("gltf", "asked for " + std::to_string(options.remesh.quads) + " quads, which are " +
                             std::to_string(2 * options.remesh.quads) + " triangles, the surfaces have " +
                             std::to_string(written));

  // From here on nothing fails: the document is edited as a whole. A surface without a quad keeps its
  // primitives as they are.
  const std::set<std::size_t> before = gltf::referred_accessors(state);
  const std::set<std::size_t> views_before = gltf::referred_views(state);
  const std::size_t first_new = gltf::array_of(state.json, "accessors").size(),
                    first_view = gltf::array_of(state.json, "bufferViews").size();
  for (std::size_t s = 0; s < jobs.size(); ++s) {
    if (all[s].result.report.quads > 0) gltf::write_back(state, jobs[s], all[s], options.source_map);
    const gltf::Gathered& gathered_one = jobs[s].gathered;
    const GltfRepairs& repairs = gathered_one.surface.repairs;
    if (repairs.bind_rows > 0 || repairs.singular_binds > 0)
      state.json["skins"][at(gathered_one.surface.skin)]["inverseBindMatrices"] =
          gltf::append_matrices(state, gathered_one.inverse_bind);
    if (repairs.loose_roots > 0)
      if (const Expected<gltf::NodeTree> tree = gltf::NodeTree::read(state))  // it may have changed for another skin
        if (gltf::loose_roots(state, *tree, at(gathered_one.surface.skin)) > 0)
          gltf::join_roots(state, *tree, at(gathered_one.surface.skin));
    all[s].surface = std::move(jobs[s].gathered.surface);
  }
  gltf::sign(state);
  gltf::drop_unused_extension(state, gltf::draco_name);
  gltf::reuse_accessors(state, first_new, before);
  gltf::drop_unused_bytes(state, first_view, views_before);
  return all;
}

}  // namespace quadrig
