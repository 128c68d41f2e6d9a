// Remeshing, and the quads into the caller's arrays.
#include "io/keep.hpp"
#include "memory.hpp"
#include "quadrig/closest.hpp"

using namespace quadrig;

/// The result keeps what its source refers to alive by itself: the asset may go first.
struct quadrig_quads {
  RemeshResult result;
  std::vector<std::uint32_t> source;  // triangle or polygon, one a vertex
  std::vector<double> barycentric;    // 3 a vertex; empty of an asset from files
};

namespace {

using detail::at;

void find_sources(const quadrig_asset& asset, quadrig_quads& quads) {
  const QuadMesh& mesh = quads.result.mesh;
  const bool given = asset.triangles.rows() > 0;
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const Index t = asset.source_polygon[at(mesh.source[at(v)].face)];
    quads.source.push_back(static_cast<std::uint32_t>(t));
    if (!given) continue;
    // By place: the door may have turned, welded or flipped the face.
    const auto corner = [&](int i) -> Vector3 { return asset.positions.row(asset.triangles(t, i)).transpose(); };
    const SurfaceHit hit = closest_on_triangle(mesh.positions.row(v).transpose(), corner(0), corner(1), corner(2));
    for (int i = 0; i < 3; ++i) quads.barycentric.push_back(hit.barycentric[i]);
  }
}

/// Half-edges of the asset's mesh for edges in the caller's vertices. \fails bad_option
Expected<std::vector<Index>> edges_to_keep(const quadrig_asset& asset, const quadrig_options& options,
                                           Context& context) {
  if (options.edge_count == 0) return std::vector<Index>{};
  if (!options.edges) return c::null_argument("options.edges");
  if (asset.triangles.rows() == 0)
    return Error{ErrorCode::bad_option, "are for assets made from arrays", "options.edges", "leave them out"};
  PolygonMesh given = PolygonMesh::from_triangles(asset.positions, asset.triangles);
  for (std::uint32_t e = 0; e < options.edge_count; ++e) {
    const std::uint32_t a = options.edges[2 * std::size_t{e}], b = options.edges[2 * std::size_t{e} + 1];
    if (std::max(a, b) >= static_cast<std::uint32_t>(given.vertex_count()))
      return Error{ErrorCode::bad_option, "edge " + std::to_string(e) + " has a vertex that does not exist",
                   "options.edges", "count vertices from 0"};
    given.lines.push_back({static_cast<Index>(a), static_cast<Index>(b)});
  }
  KeepOptions keep;
  keep.lines = true;
  return io::kept_halfedges(given, asset.asset->mesh, asset.source_polygon, keep, "options.edges", context);
}

/// Sizes and directions for the caller's triangles. \fails bad_option
Status add_own(const quadrig_asset& asset, const quadrig_options& options, RemeshOptions& wanted) {
  if (options.density_count == 0 && options.direction_count == 0) return {};
  const auto given = static_cast<std::size_t>(asset.triangles.rows());
  const char* field = options.density_count > 0 ? "options.density" : "options.directions";
  if (given == 0) return Error{ErrorCode::bad_option, "are for assets made from arrays", field, "leave them out"};
  if (options.density_count > 0) {
    if (!options.density) return c::null_argument("options.density");
    if (options.density_count != given)
      return Error{ErrorCode::bad_option, std::to_string(options.density_count) + " values", "options.density",
                   "give one a triangle, " + std::to_string(given)};
    wanted.sizing.emplace().largest_aspect = 1;
    for (const Index triangle : asset.source_polygon)
      wanted.sizing->own_density.push_back(options.density[at(triangle)]);
  }
  if (options.direction_count == 0) return {};
  if (!options.direction_triangles || !options.directions) return c::null_argument("options.directions");
  std::vector<std::vector<Index>> faces(given);
  for (std::size_t f = 0; f < asset.source_polygon.size(); ++f)
    faces[at(asset.source_polygon[f])].push_back(static_cast<Index>(f));
  for (std::size_t k = 0; k < options.direction_count; ++k) {
    const std::uint32_t triangle = options.direction_triangles[k];
    if (triangle >= given)
      return Error{ErrorCode::bad_option, "triangle " + std::to_string(triangle) + " does not exist",
                   "options.direction_triangles", "count triangles from 0"};
    const double weight =
        options.direction_weights ? options.direction_weights[k] : std::numeric_limits<double>::infinity();
    const double* d = options.directions + 3 * k;
    for (const Index f : faces[triangle]) wanted.directions.own.push_back({f, Vector3(d[0], d[1], d[2]), weight});
  }
  return {};
}

/// Factors of the density. \fails bad_option
Status add_factors(const quadrig_asset& asset, const quadrig_options& options, RemeshOptions& wanted) {
  if (options.density_factor_count > 0) {
    const auto given = static_cast<std::size_t>(asset.triangles.rows());
    if (!options.density_factors) return c::null_argument("options.density_factors");
    if (options.density_factor_count != given || given == 0)
      return Error{ErrorCode::bad_option, std::to_string(options.density_factor_count) + " values",
                   "options.density_factors", "give one a triangle of an asset made from arrays"};
    for (const Index triangle : asset.source_polygon)
      wanted.density_factors.push_back(options.density_factors[at(triangle)]);
  }
  if (options.bone_density_count == 0) return {};
  if (!options.bone_density) return c::null_argument("options.bone_density");
  if (!asset.asset->rig || options.bone_density_count != asset.asset->rig->skeleton.bones.size())
    return Error{ErrorCode::bad_option, std::to_string(options.bone_density_count) + " values", "options.bone_density",
                 "give one a bone"};
  wanted.bone_density.assign(options.bone_density, options.bone_density + options.bone_density_count);
  return {};
}

template <class Out, class Value>
quadrig_status put(const quadrig_quads* quads, Out* out, std::size_t capacity, std::size_t count, Value value) {
  if (!quads || (!out && count > 0)) return quadrig_bad_option;
  if (capacity < count) return quadrig_too_small;
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<Out>(value(i));
  return quadrig_ok;
}

}  // namespace

extern "C" {

quadrig_status quadrig_remesh(quadrig_job* job, const quadrig_asset* asset, const quadrig_options* options,
                              quadrig_quads** quads) {
  if (quads) *quads = nullptr;
  return c::guarded(job, [&](Context& context) -> Expected<quadrig_status> {
    if (!asset) return c::null_argument("asset");
    if (!quads) return c::null_argument("quads");
    const Expected<quadrig_options> own = c::read_options(options);
    if (!own) return own.error();
    Expected<RemeshOptions> wanted = c::remesh_options(*own);
    if (!wanted) return wanted.error();
    Expected<std::vector<Index>> features = edges_to_keep(*asset, *own, context);
    if (!features) return features.error();
    wanted->features = std::move(*features);
    if (Status status = add_own(*asset, *own, *wanted); !status) return status.error();
    if (Status status = add_factors(*asset, *own, *wanted); !status) return status.error();
    if (own->keep & (quadrig_keep_materials | quadrig_keep_textures))
      context.warn("options.keep", "an asset has neither materials nor textures: their borders are kept of glTF files");
    const double bones = asset->asset->rig ? asset->asset->rig->skeleton.bone_count() : 0;
    const double bytes = c::remesh_bytes(asset->asset->mesh.face_count(), bones, wanted->quads);
    if (const quadrig_status fits = c::within_limit(job, bytes, "ask for fewer quads, or raise the limit")) return fits;
    Expected<RemeshResult> result = remesh(*asset->asset, *wanted, context);
    if (!result) return result.error();
    auto made = std::make_unique<quadrig_quads>();
    made->result = std::move(*result);
    find_sources(*asset, *made);
    *quads = made.release();
    return quadrig_ok;
  });
}

void quadrig_quads_destroy(quadrig_quads* quads) { delete quads; }

quadrig_status quadrig_quads_figures(const quadrig_quads* quads, quadrig_figures* figures) {
  if (!quads || !figures || figures->size < 2 * sizeof(size_t) || figures->size > c::most_struct_bytes)
    return quadrig_bad_option;
  const RemeshReport& report = quads->result.report;
  quadrig_figures all{};
  all.quads = at(report.quads);
  all.vertices = at(report.vertices);
  all.irregular = at(report.irregular);
  all.minimum_count = at(report.minimum_count);
  all.scaled_jacobian_average = report.scaled_jacobian_average;
  all.scaled_jacobian_minimum = report.scaled_jacobian_minimum;
  all.seconds = report.seconds.total;
  c::put_defaults(figures, figures->size, all);
  return quadrig_ok;
}

size_t quadrig_quads_count(const quadrig_quads* quads) { return quads ? at(quads->result.mesh.quad_count()) : 0; }
size_t quadrig_quads_vertex_count(const quadrig_quads* quads) {
  return quads ? at(quads->result.mesh.vertex_count()) : 0;
}

quadrig_status quadrig_quads_positions(const quadrig_quads* quads, double* out, size_t capacity) {
  return put(quads, out, capacity, 3 * quadrig_quads_vertex_count(quads),
             [&](std::size_t i) { return quads->result.mesh.positions.data()[i]; });
}

quadrig_status quadrig_quads_positions_f(const quadrig_quads* quads, float* out, size_t capacity) {
  return put(quads, out, capacity, 3 * quadrig_quads_vertex_count(quads),
             [&](std::size_t i) { return quads->result.mesh.positions.data()[i]; });
}

quadrig_status quadrig_quads_twins(const quadrig_quads* quads, uint32_t* out, size_t capacity) {
  return put(quads, out, capacity, quadrig_quads_vertex_count(quads), [&](std::size_t v) {
    const std::vector<Index>& twin = quads->result.twin;
    return v < twin.size() && twin[v] != no_index ? static_cast<std::uint32_t>(twin[v]) : UINT32_MAX;
  });
}

quadrig_status quadrig_quads_indices(const quadrig_quads* quads, uint32_t* out, size_t capacity) {
  return put(quads, out, capacity, 4 * quadrig_quads_count(quads),
             [&](std::size_t i) { return quads->result.mesh.quads.data()[i]; });
}

quadrig_status quadrig_quads_weights(const quadrig_quads* quads, size_t influences, uint32_t* joints, float* weights,
                                     size_t capacity) {
  if (!quads || !quads->result.weights || influences == 0 || !joints || !weights) return quadrig_bad_option;
  const std::size_t vertices = quadrig_quads_vertex_count(quads);
  if (vertices > 0 && capacity / vertices < influences) return quadrig_too_small;
  for (std::size_t v = 0; v < vertices; ++v) {
    // The strongest so far, kept in order in the caller's own array.
    uint32_t* joint = joints + v * influences;
    float* weight = weights + v * influences;
    std::size_t count = 0;
    for (SkinWeights::InnerIterator it(*quads->result.weights, static_cast<Index>(v)); it; ++it) {
      const auto value = static_cast<float>(it.value());
      if (!(value > 0)) continue;
      std::size_t place = count;
      while (place > 0 && weight[place - 1] < value) --place;
      if (place >= influences) continue;
      count = std::min(count + 1, influences);
      for (std::size_t k = count - 1; k > place; --k) joint[k] = joint[k - 1], weight[k] = weight[k - 1];
      joint[place] = static_cast<uint32_t>(it.col());
      weight[place] = value;
    }
    double sum = 0;
    for (std::size_t k = 0; k < count; ++k) sum += static_cast<double>(weight[k]);
    for (std::size_t k = 0; k < count; ++k) weight[k] = static_cast<float>(static_cast<double>(weight[k]) / sum);
    for (std::size_t k = count; k < influences; ++k) joint[k] = 0, weight[k] = 0;
  }
  return quadrig_ok;
}

quadrig_status quadrig_quads_source(const quadrig_quads* quads, uint32_t* triangles, size_t capacity,
                                    double* barycentric, size_t barycentric_capacity) {
  if (!quads || (barycentric && quads->barycentric.empty())) return quadrig_bad_option;
  if ((triangles && capacity < quads->source.size()) ||
      (barycentric && barycentric_capacity < quads->barycentric.size()))
    return quadrig_too_small;
  if (triangles) std::copy(quads->source.begin(), quads->source.end(), triangles);
  if (barycentric) std::copy(quads->barycentric.begin(), quads->barycentric.end(), barycentric);
  return quadrig_ok;
}

}  // extern "C"
