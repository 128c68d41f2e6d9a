// Skinned surfaces into quads, and back into their file.
#include <algorithm>
#include <map>

#include "primitives.hpp"
#include "quadrig/gltf.hpp"
#include "regions.hpp"

namespace quadrig {
namespace gltf {
namespace {

/// Shells of one surface, with the count that each is due.
struct Shells {
  Components components;
  std::vector<double> area;  ///< in the scene
  std::vector<char> kept;
  double kept_area = 0;
};

/// Which shells are remeshed: those whose share of the count is large enough, or the largest of all where none is.
std::vector<Shells> choose_shells(const std::vector<Gathered>& all, const GltfRemeshOptions& options) {
  std::vector<Shells> result;
  double whole = 0;
  for (const Gathered& one : all) {
    const TriangleMesh<double>& mesh = one.surface.asset.mesh;
    Shells shells;
    shells.components = face_components(mesh);
    shells.area.assign(at(shells.components.count), 0.0);
    const double scale = one.surface.world_scale * one.surface.world_scale;
    for (Index f = 0; f < mesh.face_count(); ++f)
      shells.area[at(shells.components.of_face[at(f)])] += scale * mesh.area(f);
    for (const double area : shells.area) whole += area;
    shells.kept.assign(shells.area.size(), 0);
    result.push_back(std::move(shells));
  }
  Shells* largest_of = nullptr;
  std::size_t largest = 0;
  bool any = false;
  for (Shells& shells : result)
    for (std::size_t c = 0; c < shells.area.size(); ++c) {
      shells.kept[c] = options.remesh.quads * shells.area[c] >= options.least_shell_quads * whole;
      any = any || shells.kept[c];
      if (!largest_of || shells.area[c] > largest_of->area[largest]) largest_of = &shells, largest = c;
    }
  if (!any && largest_of) largest_of->kept[largest] = 1;
  for (Shells& shells : result)
    for (std::size_t c = 0; c < shells.area.size(); ++c)
      if (shells.kept[c]) shells.kept_area += shells.area[c];
  return result;
}

/// The kept shells as an asset of their own; `source_face` is filled with the face that each of its faces was.
Expected<Asset> kept_part(const GltfSurface& surface, const Shells& shells, std::vector<Index>& source_face) {
  const TriangleMesh<double>& mesh = surface.asset.mesh;
  std::vector<Index> vertex(at(mesh.vertex_count()), no_index), back;
  for (Index f = 0; f < mesh.face_count(); ++f)
    if (shells.kept[at(shells.components.of_face[at(f)])]) source_face.push_back(f);
  Triangles faces(static_cast<Eigen::Index>(source_face.size()), 3);
  for (std::size_t k = 0; k < source_face.size(); ++k)
    for (int i = 0; i < 3; ++i) {
      const Index v = mesh.faces()(source_face[k], i);
      if (vertex[at(v)] == no_index) {
        vertex[at(v)] = static_cast<Index>(back.size());
        back.push_back(v);
      }
      faces(static_cast<Eigen::Index>(k), i) = vertex[at(v)];
    }
  Points<double> positions(static_cast<Eigen::Index>(back.size()), 3);
  const SkinWeights& all = surface.asset.rig->weights;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (std::size_t k = 0; k < back.size(); ++k) {
    positions.row(static_cast<Eigen::Index>(k)) = mesh.positions().row(back[k]);
    for (SkinWeights::InnerIterator it(all, back[k]); it; ++it)
      entries.emplace_back(static_cast<Index>(k), static_cast<Index>(it.col()), it.value());
  }
  Expected<TriangleMesh<double>> part = TriangleMesh<double>::create(std::move(positions), std::move(faces));
  if (!part) return part.error();
  Asset asset;
  asset.mesh = std::move(*part);
  Rig rig;
  rig.skeleton = surface.asset.rig->skeleton;
  rig.weights.resize(static_cast<Index>(back.size()), all.cols());
  rig.weights.setFromTriplets(entries.begin(), entries.end());
  asset.rig = std::move(rig);
  return asset;
}

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
Points<double> smooth_normals(const QuadMesh& mesh) {
  Points<double> normals = Points<double>::Zero(mesh.vertex_count(), 3);
  for (Index q = 0; q < mesh.quad_count(); ++q) {
    Vector3 p[4];
    for (int i = 0; i < 4; ++i) p[i] = mesh.positions.row(mesh.quads(q, i)).transpose();
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
};

void add_quads(Job& job, const GltfRemeshed& done, Index influences) {
  const QuadMesh& quads = done.result.mesh;
  Regions regions(job.gathered, done.remeshed, job.source_face);
  const Points<double> normals = smooth_normals(quads);
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
        return PrimitiveBuilder::Vertex{quads.positions.row(v).transpose(), normals.row(v).transpose(), own,
                                        strongest(*done.result.weights, v, influences)};
      });
    }
    builder.triangle(corner[0], corner[1], corner[2]);
    builder.triangle(corner[0], corner[2], corner[3]);
  }
}

/// Shells that stay as they are: their triangles with their own vertices and, where the file has them, normals.
void add_passed(Job& job, const Shells& shells, GltfRemeshed& done, Index influences) {
  const Gathered& gathered = job.gathered;
  const GltfSurface& surface = gathered.surface;
  const TriangleMesh<double>& mesh = surface.asset.mesh;
  Points<double> normals = Points<double>::Zero(mesh.vertex_count(), 3);
  for (Index f = 0; f < mesh.face_count(); ++f)
    for (int i = 0; i < 3; ++i) normals.row(mesh.faces()(f, i)) += mesh.area(f) * mesh.normals().row(f);
  for (const char kept : shells.kept) done.passed_shells += kept ? 0 : 1;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (shells.kept[at(shells.components.of_face[at(f)])]) continue;
    ++done.passed_triangles;
    const Index number = surface.source_primitive[at(f)];
    const Primitive& primitive = gathered.primitives[at(number)];
    std::array<Index, 3> corner{};
    for (int i = 0; i < 3; ++i) {
      const Index v = mesh.faces()(f, i), source = gathered.corner_vertex[at(3 * f + i)];
      // Keys of the quads are small; these begin at 2^63.
      const std::uint64_t key =
          std::uint64_t{1} << 63 | static_cast<std::uint64_t>(v) << 31 | static_cast<std::uint64_t>(source);
      corner[static_cast<std::size_t>(i)] = job.builders[at(number)].vertex(key, [&] {
        PrimitiveBuilder::Vertex made{mesh.position(v), normals.row(v).transpose(),
                                      gathered.values.row(source).transpose(),
                                      strongest(surface.asset.rig->weights, v, influences)};
        for (const std::size_t a : primitive.attributes)
          if (gathered.attributes[a].name == "NORMAL" && gathered.attributes[a].width == 3)
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
void write_back(State& state, const Job& job, GltfRemeshed& done, Context& context) {
  const Gathered& gathered = job.gathered;
  const Index joints = gathered.surface.asset.rig->skeleton.bone_count();
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
    Json kept = Json::array();
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
      const Json old = primitives[k];
      kept.push_back(builder.write(state, old, gathered, gathered.primitives[builder_of[k]], joints));
      done.written_vertices += builder.vertex_count();
      ++done.written_primitives;
    }
    state.json["meshes"][at(m)]["primitives"] = std::move(kept);
    state.edited = true;
  }
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
  Expected<std::vector<gltf::Gathered>> gathered = gltf::gather(document.state(), options.prepare, clips, context);
  if (!gathered) return gathered.error();
  const std::vector<gltf::Shells> shells = gltf::choose_shells(*gathered, options);
  double whole = 0;
  for (const gltf::Shells& one : shells) whole += one.kept_area;

  std::vector<GltfRemeshed> all;
  std::vector<gltf::Job> jobs;
  for (std::size_t s = 0; s < gathered->size(); ++s) {
    gltf::Job job;
    job.gathered = std::move((*gathered)[s]);
    job.builders.resize(job.gathered.primitives.size());
    GltfRemeshed done;
    if (shells[s].kept_area > 0) {
      Expected<Asset> part = gltf::kept_part(job.gathered.surface, shells[s], job.source_face);
      if (!part) return part.error();
      RemeshOptions remesh_options = options.remesh;
      remesh_options.quads =
          std::max<Index>(6, static_cast<Index>(std::lround(options.remesh.quads * shells[s].kept_area / whole)));
      if (options.pose_source == GltfPoses::clips)
        remesh_options.poses = clip_poses(job.gathered.surface.asset.rig->clips, options.most_poses);
      Expected<RemeshResult> result = remesh(*part, remesh_options, context);
      if (!result) {
        Error error = result.error();
        error.where = gltf::numbered("skins", at(job.gathered.surface.skin)) + ", " + error.where;
        return error;
      }
      done.result = std::move(*result);
      done.remeshed = std::move(part->mesh);
      gltf::add_quads(job, done, options.remesh.influences);
    }
    gltf::add_passed(job, shells[s], done, options.remesh.influences);
    all.push_back(std::move(done));
    jobs.push_back(std::move(job));
  }
  // From here on nothing fails: the document is edited as a whole.
  gltf::State& state = document.state();
  const std::set<std::size_t> before = gltf::referred_accessors(state);
  const std::size_t first_new = gltf::array_of(state.json, "accessors").size();
  for (std::size_t s = 0; s < jobs.size(); ++s) {
    gltf::write_back(state, jobs[s], all[s], context);
    const GltfRepairs& repairs = jobs[s].gathered.surface.repairs;
    if (repairs.bind_rows > 0 || repairs.singular_binds > 0)
      state.json["skins"][at(jobs[s].gathered.surface.skin)]["inverseBindMatrices"] =
          gltf::append_matrices(state, jobs[s].gathered.inverse_bind);
    all[s].surface = std::move(jobs[s].gathered.surface);
  }
  gltf::reuse_accessors(state, first_new, before);
  return all;
}

}  // namespace quadrig
