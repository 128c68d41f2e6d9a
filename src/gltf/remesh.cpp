// Surfaces into quads, and back into their file.
#include <algorithm>
#include <map>

#include "primitives.hpp"
#include "regions.hpp"
#include "roots.hpp"
#include "shells.hpp"

namespace quadrig {
namespace gltf {
namespace {

std::vector<std::pair<Index, double>> strongest(const SkinWeights& weights, Index row, Index influences) {
  std::vector<std::pair<Index, double>> own;
  for (SkinWeights::InnerIterator it(weights, row); it; ++it)
    if (it.value() > 0) own.emplace_back(static_cast<Index>(it.col()), it.value());
  std::sort(own.begin(), own.end(), [](const auto& a, const auto& b) {
    return a.second != b.second ? a.second > b.second : a.first < b.first;
  });
  if (own.size() > at(influences)) own.resize(at(influences));
  double sum = 0;
  for (const auto& entry : own) sum += entry.second;
  for (auto& entry : own) entry.second /= sum;
  return own;
}

/// Unit normals of the quads' vertices: of the faces around them, by area.
Points<double> smooth_normals(const QuadMesh& mesh, const Points<double>& positions) {
  Points<double> normals = Points<double>::Zero(mesh.vertex_count(), 3);
  for (Index q = 0; q < mesh.quad_count(); ++q) {
    Vector3 p[4];
    for (int i = 0; i < 4; ++i) p[i] = positions.row(mesh.quads(q, i)).transpose();
    const Vector3 n = (p[2] - p[0]).cross(p[3] - p[1]);
    for (int i = 0; i < 4; ++i) normals.row(mesh.quads(q, i)) += n.transpose();
  }
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const double length = normals.row(v).norm();
    if (length > 0)
      normals.row(v) /= length;
    else
      normals.row(v) = Vector3::UnitZ().transpose();
  }
  return normals;
}

/// The corner that both triangles of a quad begin with: of the diagonal that folds neither half over the other, the
/// shorter where both do not.
int first_corner(const QuadMesh& mesh, Index q) {
  Vector3 p[4];
  for (int i = 0; i < 4; ++i) p[i] = mesh.positions.row(mesh.quads(q, i)).transpose();
  const auto fold = [&](int i) {
    const Vector3 &a = p[i], &b = p[(i + 1) % 4], &c = p[(i + 2) % 4], &d = p[(i + 3) % 4];
    return (b - a).cross(c - a).dot((c - a).cross(d - a)) <= 0;
  };
  if (fold(0) != fold(1)) return fold(0) ? 1 : 0;
  return (p[0] - p[2]).squaredNorm() <= (p[1] - p[3]).squaredNorm() ? 0 : 1;
}

/// A surface on its way through.
struct Job {
  Gathered gathered;
  std::vector<Index> source_face;
  std::vector<PrimitiveBuilder> builders;
  std::vector<Index> primitive_number;  ///< of each primitive of the surface, counted over all meshes of the file
};

/// Where a point of the prepared surface lies on the input: primitive, triangle, and the second and third of its
/// barycentric coordinates there.
Eigen::Vector4d source_of(const Job& job, Index face, const Vector3& p) {
  const Gathered& gathered = job.gathered;
  const Index t = gathered.source_triangle[at(face)];
  Vector3 corner[3];
  for (int i = 0; i < 3; ++i) corner[i] = gathered.positions.row(gathered.triangles(t, i)).transpose();
  const SurfaceHit hit = closest_on_triangle(p, corner[0], corner[1], corner[2]);
  return {static_cast<double>(job.primitive_number[at(gathered.triangle_primitive[at(t)])]),
          static_cast<double>(gathered.triangle_number[at(t)]), hit.barycentric[1], hit.barycentric[2]};
}

/// How the normals of the quads' vertices change with each morph target that has normals: made anew, as the normals
/// are.
struct MorphNormals {
  std::vector<std::pair<Eigen::Index, Points<double>>> changes;  ///< first column, n×3

  MorphNormals(const Gathered& gathered, const QuadMesh& quads, const Points<double>& normals, Regions& regions) {
    std::map<std::size_t, Eigen::Index> position_of;  // a target
    for (const Attribute& attribute : gathered.attributes)
      if (attribute.target != Attribute::no_target && attribute.name == "POSITION")
        position_of[attribute.target] = attribute.first;
    for (const Attribute& attribute : gathered.attributes) {
      if (attribute.target == Attribute::no_target || attribute.name != "NORMAL") continue;
      const Eigen::Index offset = position_of.at(attribute.target);  // gather gives every target one
      Points<double> moved = quads.positions;
      for (Index v = 0; v < quads.vertex_count(); ++v)
        moved.row(v) += regions.values_at(quads.source[at(v)]).segment<3>(offset).transpose();
      changes.emplace_back(attribute.first, smooth_normals(quads, moved) - normals);
    }
  }
  void put(Index v, Eigen::VectorXd& values) const {
    for (const auto& [first, change] : changes) values.segment<3>(first) = change.row(v).transpose();
  }
};

void add_quads(Job& job, const GltfRemeshed& done, Index influences) {
  const QuadMesh& quads = done.result.mesh;
  Regions regions(job.gathered, done.remeshed, job.source_face);
  const Points<double> normals = smooth_normals(quads, quads.positions);
  const MorphNormals morphs(job.gathered, quads, normals, regions);
  // Values that a vertex has in a primitive: more than one where a seam runs through it.
  std::map<std::pair<Index, Index>, std::vector<Eigen::VectorXd>> variants;
  for (Index q = 0; q < quads.quad_count(); ++q) {
    const Regions::QuadValues values = regions.of_quad(quads, q);
    PrimitiveBuilder& builder = job.builders[at(values.primitive)];
    std::array<Index, 4> corner{};
    const int first = first_corner(quads, q);
    for (int i = 0; i < 4; ++i) {
      const int from = (first + i) % 4;
      const Index v = quads.quads(q, from);
      const Eigen::VectorXd& own = values.corners[static_cast<std::size_t>(from)];
      std::vector<Eigen::VectorXd>& known = variants[{values.primitive, v}];
      std::size_t variant = 0;
      while (variant < known.size() && !regions.alike(known[variant], own)) ++variant;
      if (variant == known.size()) known.push_back(own);
      const std::uint64_t key = static_cast<std::uint64_t>(variant) << 32 | static_cast<std::uint32_t>(v);
      corner[static_cast<std::size_t>(i)] = builder.vertex(key, [&] {
        const Vector3 p = quads.positions.row(v).transpose();
        PrimitiveBuilder::Vertex made{p, normals.row(v).transpose(), own, {}, {}};
        morphs.put(v, made.values);
        made.source = source_of(job, job.source_face[at(quads.source[at(v)].face)], p);
        if (done.result.weights) made.weights = strongest(*done.result.weights, v, influences);
        return made;
      });
    }
    builder.quad(corner[0], corner[1], corner[2], corner[3]);
  }
}

/// Shells that stay as they are: their triangles with their own vertices and, where the file has them, normals.
void add_passed(Job& job, const Shells& shells, Index influences) {
  const Gathered& gathered = job.gathered;
  const GltfSurface& surface = gathered.surface;
  const TriangleMesh<double>& mesh = surface.asset.mesh;
  Points<double> normals = Points<double>::Zero(mesh.vertex_count(), 3);
  for (Index f = 0; f < mesh.face_count(); ++f)
    for (int i = 0; i < 3; ++i) normals.row(mesh.faces()(f, i)) += mesh.area(f) * mesh.normals().row(f);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (shells.kept[at(shells.components.of_face[at(f)])]) continue;
    const Index number = surface.source_primitive[at(f)];
    const Primitive& primitive = gathered.primitives[at(number)];
    std::array<Index, 3> corner{};
    for (int i = 0; i < 3; ++i) {
      const Index v = mesh.faces()(f, i), source = gathered.corner_vertex[at(3 * f + i)];
      // Keys of the quads are small; these begin at 2^63.
      const std::uint64_t key =
          std::uint64_t{1} << 63 | static_cast<std::uint64_t>(v) << 31 | static_cast<std::uint64_t>(source);
      corner[static_cast<std::size_t>(i)] = job.builders[at(number)].vertex(key, [&] {
        PrimitiveBuilder::Vertex made{mesh.position(v),
                                      normals.row(v).transpose(),
                                      gathered.values.row(source).transpose(),
                                      {},
                                      source_of(job, f, mesh.position(v))};
        if (surface.asset.rig) made.weights = strongest(surface.asset.rig->weights, v, influences);
        for (const std::size_t a : primitive.attributes)
          if (gathered.attributes[a].name == "NORMAL" && gathered.attributes[a].target == Attribute::no_target &&
              gathered.attributes[a].width == 3)
            made.normal = made.values.segment<3>(gathered.attributes[a].first);
        const double length = made.normal.norm();
        made.normal = length > 0 && std::isfinite(length) ? Vector3(made.normal / length) : Vector3::UnitZ();
        return made;
      });
    }
    job.builders[at(number)].triangle(corner[0], corner[1], corner[2]);
  }
}

/// The primitives of the surface's meshes, replaced. A primitive that no quad fell to is left out, unless its mesh
/// would be left without any.
void write_back(State& state, const Job& job, GltfRemeshed& done, bool source_map, Context& context) {
  const Gathered& gathered = job.gathered;
  for (const Index m : gathered.surface.meshes) {
    Json& primitives = state.json["meshes"][at(m)]["primitives"];
    std::vector<std::size_t> builder_of(primitives.size(), static_cast<std::size_t>(-1));
    bool any = false;
    for (std::size_t p = 0; p < gathered.primitives.size(); ++p)
      if (gathered.primitives[p].mesh == at(m)) {
        builder_of[gathered.primitives[p].number] = p;
        any = any || !job.builders[p].empty();
      }
    for (const std::size_t builder : builder_of) any = any || builder == static_cast<std::size_t>(-1);
    if (!any) {
      context.warn("gltf", numbered("meshes", at(m)) + " is smaller than a quad and stays as it is");
      continue;
    }
    LocalJson kept = Json::array();
    for (std::size_t k = 0; k < builder_of.size(); ++k) {
      if (builder_of[k] == static_cast<std::size_t>(-1)) {
        kept.push_back(primitives[k]);
        continue;
      }
      const PrimitiveBuilder& builder = job.builders[builder_of[k]];
      if (builder.empty()) {
        context.warn("gltf", numbered("meshes", at(m)) + "." + numbered("primitives", k) +
                                 " is smaller than a quad and is left out");
        continue;
      }
      const LocalJson old = Json(primitives[k]);
      kept.push_back(builder.write(state, old, gathered, gathered.primitives[builder_of[k]], source_map));
      done.written_vertices += builder.vertex_count();
      ++done.written_primitives;
    }
    replace(state.json["meshes"][at(m)]["primitives"], std::move(kept));
    state.edited = true;
  }
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
  clips.enabled = options.pose_source == GltfPoses::clips;
  gltf::State& state = document.state();
  Expected<std::vector<gltf::Gathered>> gathered =
      gltf::gather(state, options.prepare, clips, options.selection, context);
  if (!gathered) return gathered.error();
  if (std::ranges::none_of(*gathered, [](const gltf::Gathered& one) { return one.surface.asset.rig.has_value(); })) {
    if (options.remesh.group_borders)
      return Error{ErrorCode::bad_option, "vertex groups are the columns of skin weights", "group_borders",
                   "give a file with a skin"};
    if (options.remesh.preset == FieldPreset::thesis)
      return Error{ErrorCode::bad_option, "the thesis preset needs a rig", "preset", "use the static one"};
  }
  std::vector<gltf::Shells> shells = gltf::choose_shells(*gathered, options);
  double whole = 0, begun = 0;
  for (const gltf::Shells& one : shells) whole += one.kept_area;

  std::vector<GltfRemeshed> all;
  std::vector<gltf::Job> jobs;
  const Error* failed = nullptr;
  bool any = false;
  gltf::Budget written;
  for (std::size_t s = 0; s < gathered->size(); ++s) {
    gltf::Job job;
    job.gathered = std::move((*gathered)[s]);
    job.builders.resize(job.gathered.primitives.size());
    if (Status status = gltf::number_primitives(state, job); !status && options.source_map) return status.error();
    GltfRemeshed done;
    if (job.gathered.failure) {
      done.failures.push_back({job.gathered.surface.label(), *job.gathered.failure});
    } else if (shells[s].kept_area > 0) {
      const double quads = options.remesh.quads * shells[s].kept_area / whole;
      // Each vertex that is written carries all columns, some times over: how many quads is the caller's choice, how
      // many columns beyond what any surface has is the file's.
      constexpr std::size_t usual_columns = 64;
      const auto columns =
          std::max(static_cast<std::size_t>(job.gathered.values.cols()), usual_columns) - usual_columns;
      if (Status status = gltf::charge(state, written, static_cast<std::size_t>(4 * quads), columns,
                                       job.gathered.surface.label() + ": what the vertices of the quads carry");
          !status)
        return status.error();
      context.log(job.gathered.surface.label());
      const ProgressPart progress(context, begun / whole, (begun + shells[s].kept_area) / whole);
      begun += shells[s].kept_area;
      if (Status status = gltf::remesh_shells(job.gathered, shells[s], quads, options, done, job.source_face, context);
          !status)
        return status.error();
    }
    for (const char kept : shells[s].kept) done.passed_shells += kept ? 0 : 1;
    for (const Index c : shells[s].components.of_face) done.passed_triangles += shells[s].kept[at(c)] ? 0 : 1;
    if (shells[s].keeps_any()) {
      if (context.cancelled()) return cancelled_error("gltf");
      gltf::add_quads(job, done, options.remesh.influences);
      gltf::add_passed(job, shells[s], options.remesh.influences);
      for (std::size_t p = 0; p < job.builders.size(); ++p)
        if (job.gathered.primitives[p].tangents)
          job.builders[p].make_tangents(job.gathered, job.gathered.primitives[p]);
      if (context.cancelled()) return cancelled_error("gltf");
      any = true;
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

  // From here on nothing fails: the document is edited as a whole. A surface without a quad keeps its
  // primitives as they are.
  const std::set<std::size_t> before = gltf::referred_accessors(state);
  const std::set<std::size_t> views_before = gltf::referred_views(state);
  const std::size_t first_new = gltf::array_of(state.json, "accessors").size(),
                    first_view = gltf::array_of(state.json, "bufferViews").size();
  for (std::size_t s = 0; s < jobs.size(); ++s) {
    if (shells[s].keeps_any()) gltf::write_back(state, jobs[s], all[s], options.source_map, context);
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
  gltf::drop_unused_extension(state, gltf::draco_name);
  gltf::reuse_accessors(state, first_new, before);
  gltf::drop_unused_bytes(state, first_view, views_before);
  return all;
}

}  // namespace quadrig
