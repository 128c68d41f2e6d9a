// Surfaces and rigs from the caller's arrays, and from files.
#include "memory.hpp"
#include "quadrig/io.hpp"

using namespace quadrig;

namespace {

constexpr std::size_t most_index = std::size_t{1} << 30;

Error bad(std::string where, std::string what) {
  return {ErrorCode::bad_input, std::move(what), std::move(where), "mend what is given"};
}

Expected<Points<double>> read_positions(const quadrig_mesh& mesh) {
  if (!mesh.positions == !mesh.positions_f)
    return Error{ErrorCode::bad_option, "give either doubles or floats", "mesh.positions", "leave the other null"};
  if (mesh.vertex_count > most_index) return bad("mesh.vertex_count", "is more than 2^30");
  Points<double> positions(static_cast<Eigen::Index>(mesh.vertex_count), 3);
  for (std::size_t i = 0; i < 3 * mesh.vertex_count; ++i)
    positions.data()[i] = mesh.positions ? mesh.positions[i] : static_cast<double>(mesh.positions_f[i]);
  return positions;
}

Expected<Triangles> read_triangles(const quadrig_mesh& mesh) {
  if (!mesh.triangles && mesh.triangle_count > 0) return c::null_argument("mesh.triangles");
  if (mesh.triangle_count > most_index / 2) return bad("mesh.triangle_count", "is more than 2^29");
  Triangles triangles(static_cast<Eigen::Index>(mesh.triangle_count), 3);
  for (std::size_t i = 0; i < 3 * mesh.triangle_count; ++i) {
    if (mesh.triangles[i] >= mesh.vertex_count)
      return bad("triangle " + std::to_string(i / 3), "names a vertex that is not there");
    triangles.data()[i] = static_cast<Index>(mesh.triangles[i]);
  }
  return triangles;
}

/// A bone that its parents lead back to, or none.
Index bone_in_ring(const Skeleton& skeleton) {
  std::vector<Index> seen_from(skeleton.bones.size(), no_index);
  for (Index start = 0; start < skeleton.bone_count(); ++start)
    for (Index b = start; b != no_index; b = skeleton.bones[detail::at(b)].parent) {
      if (seen_from[detail::at(b)] == start) return b;
      if (seen_from[detail::at(b)] != no_index) break;  // all above it was walked
      seen_from[detail::at(b)] = start;
    }
  return no_index;
}

Expected<Skeleton> read_bones(const quadrig_mesh& mesh) {
  if (mesh.bone_count > 1'000'000) return bad("mesh.bone_count", "is more than 1000000");
  Skeleton skeleton;
  for (std::size_t b = 0; b < mesh.bone_count; ++b) {
    const quadrig_bone& given = mesh.bones[b];
    const std::string where = "bone " + std::to_string(b);
    Bone bone;
    bone.head = Eigen::Map<const Vector3>(given.head);
    bone.tail = Eigen::Map<const Vector3>(given.tail);
    if (!bone.head.allFinite() || !bone.tail.allFinite()) return bad(where, "has numbers that are not finite");
    if (given.parent < -1 || given.parent >= static_cast<std::int64_t>(mesh.bone_count))
      return bad(where, "has a parent that is not there");
    bone.parent = given.parent;
    bone.has_direction = given.round == 0 && bone.head != bone.tail;
    skeleton.bones.push_back(std::move(bone));
  }
  if (const Index ring = bone_in_ring(skeleton); ring != no_index)
    return bad("bone " + std::to_string(ring), "is above itself in the tree of parents");
  return skeleton;
}

Expected<VertexWeights> read_weights(const quadrig_mesh& mesh) {
  if (!mesh.bones) return c::null_argument("mesh.bones");
  if (!mesh.joints || !mesh.weights) return c::null_argument("mesh.joints, mesh.weights");
  if (mesh.influences == 0 || mesh.influences > 10'000)
    return Error{ErrorCode::bad_option, "out of range", "mesh.influences", "give 1 to 10000"};
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (std::size_t v = 0; v < mesh.vertex_count; ++v) {
    const std::string where = "vertex " + std::to_string(v);
    double sum = 0;
    for (std::size_t k = v * mesh.influences; k < (v + 1) * mesh.influences; ++k) {
      const double weight = mesh.weights[k];
      if (!(weight >= 0) || !std::isfinite(weight)) return bad(where, "has a weight that is negative or not finite");
      if (weight > 0 && mesh.joints[k] >= mesh.bone_count) return bad(where, "names a bone that is not there");
      sum += weight;
    }
    if (!(sum > 0)) return bad(where, "has no weights");
    if (mesh.strict != 0 && std::abs(sum - 1) > 1e-3)
      return bad(where, "has weights that sum to " + std::to_string(sum) + ", not to 1");
    for (std::size_t k = v * mesh.influences; k < (v + 1) * mesh.influences; ++k)
      if (mesh.weights[k] > 0)
        entries.emplace_back(static_cast<Index>(v), static_cast<Index>(mesh.joints[k]), mesh.weights[k] / sum);
  }
  VertexWeights weights(static_cast<Index>(mesh.vertex_count), static_cast<Index>(mesh.bone_count));
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

Expected<quadrig_status> create(quadrig_job* job, const quadrig_mesh* given, quadrig_asset** out, Context& context) {
  if (!given) return c::null_argument("mesh");
  const Expected<quadrig_mesh> mesh = c::known_part(given, quadrig_mesh{}, "mesh");
  if (!mesh) return mesh.error();
  if (mesh->reserved != 0) return Error{ErrorCode::bad_option, "is not 0", "mesh.reserved", "call quadrig_mesh_init"};
  const double bytes =
      c::prepare_bytes(static_cast<double>(mesh->triangle_count), static_cast<double>(mesh->influences));
  if (const quadrig_status fits = c::within_limit(job, bytes, "give fewer triangles, or raise the limit")) return fits;
  Expected<Points<double>> positions = read_positions(*mesh);
  if (!positions) return positions.error();
  Expected<Triangles> triangles = read_triangles(*mesh);
  if (!triangles) return triangles.error();
  Expected<Skeleton> skeleton = Skeleton{};
  Expected<VertexWeights> weights = VertexWeights{};
  const bool rigged = mesh->bone_count > 0;
  if (rigged) {
    weights = read_weights(*mesh);
    if (!weights) return weights.error();
    skeleton = read_bones(*mesh);
    if (!skeleton) return skeleton.error();
  }
  PrepareOptions options;
  options.strict = mesh->strict != 0;
  options.weld_distance = mesh->weld_distance;
  if (Status status = options.validate(); !status) return status.error();
  Expected<Prepared> prepared =
      prepare(PolygonMesh::from_triangles(*positions, *triangles), rigged ? &*weights : nullptr, options, context);
  if (!prepared) return prepared.error();
  Asset asset;
  asset.mesh = std::move(prepared->mesh);
  if (rigged) asset.rig = Rig{std::move(*skeleton), std::move(*prepared->weights), {}};
  *out = new quadrig_asset{std::make_shared<const Asset>(std::move(asset)), std::move(prepared->source_polygon),
                           std::move(*positions), std::move(*triangles)};
  return quadrig_ok;
}

}  // namespace

extern "C" {

void quadrig_mesh_init(quadrig_mesh* mesh, size_t size) { c::put_defaults(mesh, size, quadrig_mesh{}); }

quadrig_status quadrig_asset_create(quadrig_job* job, const quadrig_mesh* mesh, quadrig_asset** asset) {
  if (asset) *asset = nullptr;
  return c::guarded(job, [&](Context& context) -> Expected<quadrig_status> {
    if (!asset) return c::null_argument("asset");
    return create(job, mesh, asset, context);
  });
}

quadrig_status quadrig_asset_load(quadrig_job* job, const char* mesh, const char* rig, const char* weights,
                                  quadrig_asset** asset) {
  if (asset) *asset = nullptr;
  return c::guarded(job, [&](Context& context) -> Expected<quadrig_status> {
    if (!asset) return c::null_argument("asset");
    if (!mesh) return c::null_argument("mesh");
    if (!rig != !weights) return c::null_argument(rig ? "weights" : "rig");
    AssetFiles files;
    files.mesh = mesh;
    if (rig) files.rig = rig, files.weights = weights;
    LoadOptions options;
    if (job->memory_limit > 0) options.limits.bytes = std::min(options.limits.bytes, c::file_bytes(job));
    if (job->memory_limit > 0) {
      const Expected<PolygonMesh> surface = read_surface(files.mesh, options.limits, context);
      if (!surface) return surface.error();
      const double triangles = static_cast<double>(surface->corners.size()) - 2.0 * surface->polygon_count();
      const double bytes = c::prepare_bytes(triangles, rig ? 4 : 0);
      if (const quadrig_status fits = c::within_limit(job, bytes, "give fewer triangles, or raise the limit"))
        return fits;
    }
    Expected<LoadedAsset> loaded = load_asset(files, options, context);
    if (!loaded) return loaded.error();
    *asset = new quadrig_asset{
        std::make_shared<const Asset>(std::move(loaded->asset)), std::move(loaded->source_polygon), {}, {}};
    return quadrig_ok;
  });
}

void quadrig_asset_destroy(quadrig_asset* asset) { delete asset; }
size_t quadrig_asset_vertex_count(const quadrig_asset* asset) {
  return asset ? static_cast<size_t>(asset->asset->mesh.vertex_count()) : 0;
}
size_t quadrig_asset_triangle_count(const quadrig_asset* asset) {
  return asset ? static_cast<size_t>(asset->asset->mesh.face_count()) : 0;
}
size_t quadrig_asset_bone_count(const quadrig_asset* asset) {
  return asset && asset->asset->rig ? asset->asset->rig->skeleton.bones.size() : 0;
}

}  // extern "C"
