// glTF in memory and in files.
#include "quadrig/gltf.hpp"
#include "gltf/gather.hpp"
#include "memory.hpp"

using namespace quadrig;

struct quadrig_bytes {
  std::string bytes;
};

namespace {

GltfLimits limits_of(const quadrig_job* job) {
  GltfLimits limits;
  if (job->memory_limit == 0) return limits;
  limits.bytes = std::min(limits.bytes, c::file_bytes(job));
  limits.values = std::min(limits.values, c::file_bytes(job) / sizeof(double));
  return limits;
}

/// Edits the document. \return quadrig_ok or quadrig_done_in_part
Expected<quadrig_status> remesh_document(quadrig_job* job, GltfDocument& document, const quadrig_options* given,
                                         Context& context) {
  const Expected<quadrig_options> options = c::read_options(given);
  if (!options) return options.error();
  const Expected<RemeshOptions> remesh = c::remesh_options(*options);
  if (!remesh) return remesh.error();
  GltfRemeshOptions own;
  own.remesh = *remesh;
  own.prepare.strict = options->strict != 0;
  own.pose_source = options->clips ? GltfPoses::clips : GltfPoses::bends;
  own.clip_directions = options->clip_directions != 0;
  own.source_map = options->source_map != 0;
  own.keep_materials = (options->keep & quadrig_keep_materials) != 0;
  own.keep_textures = (options->keep & quadrig_keep_textures) != 0;
  own.selection.unskinned = options->unskinned != 0;
  if (options->edge_count > 0)
    return Error{ErrorCode::bad_option, "are for assets made from arrays", "options.edges", "leave them out"};
  if (options->density_count > 0 || options->direction_count > 0)
    return Error{ErrorCode::bad_option, "are for assets made from arrays", "options.density, options.directions",
                 "leave them out"};
  for (std::uint32_t i = 0; i < options->select_count; ++i) {
    if (!options->select || !options->select[i]) return c::null_argument("options.select");
    own.selection.names.emplace_back(options->select[i]);
  }
  if (job->memory_limit > 0) {
    Context quiet = context.quiet(context.threads);
    const Expected<std::vector<gltf::Gathered>> surfaces =
        gltf::gather(document.state(), own.prepare, {.enabled = false}, own.selection, quiet);
    if (!surfaces) return surfaces.error();
    double triangles = 0, bones = 0;
    for (const gltf::Gathered& one : *surfaces) {
      if (one.failure) continue;
      triangles += one.surface.asset.mesh.face_count();
      bones = std::max<double>(bones, one.joints());
    }
    const double bytes = c::remesh_bytes(triangles, bones, own.remesh.quads);
    if (const quadrig_status fits = c::within_limit(job, bytes, "ask for fewer quads, or raise the limit")) return fits;
  }
  const Expected<std::vector<GltfRemeshed>> all = remesh_gltf(document, own, context);
  if (!all) return all.error();
  for (const GltfRemeshed& one : *all)
    if (!one.failures.empty()) return quadrig_done_in_part;
  return quadrig_ok;
}

}  // namespace

extern "C" {

const void* quadrig_bytes_data(const quadrig_bytes* bytes) { return bytes ? bytes->bytes.data() : nullptr; }
size_t quadrig_bytes_size(const quadrig_bytes* bytes) { return bytes ? bytes->bytes.size() : 0; }
void quadrig_bytes_destroy(quadrig_bytes* bytes) { delete bytes; }

quadrig_status quadrig_remesh_gltf(quadrig_job* job, const void* data, size_t size, const char* name,
                                   const quadrig_options* options, quadrig_bytes** glb) {
  if (glb) *glb = nullptr;
  return c::guarded(job, [&](Context& context) -> Expected<quadrig_status> {
    if (!data) return c::null_argument("data");
    if (!glb) return c::null_argument("glb");
    if (const quadrig_status fits = c::within_limit(job, 4 * static_cast<double>(size), "raise the limit")) return fits;
    Expected<GltfDocument> document = GltfDocument::parse(std::string(static_cast<const char*>(data), size),
                                                          name ? name : "memory.glb", limits_of(job), context);
    if (!document) return document.error();
    const Expected<quadrig_status> done = remesh_document(job, *document, options, context);
    if (!done || *done == quadrig_out_of_memory) return done;
    Expected<std::string> bytes = document->glb();
    if (!bytes) return bytes.error();
    *glb = new quadrig_bytes{std::move(*bytes)};
    return done;
  });
}

quadrig_status quadrig_remesh_gltf_file(quadrig_job* job, const char* input, const char* output,
                                        const quadrig_options* options) {
  return c::guarded(job, [&](Context& context) -> Expected<quadrig_status> {
    if (!input) return c::null_argument("input");
    if (!output) return c::null_argument("output");
    if (const Expected<GltfContainer> wanted = gltf_container(output); !wanted) return wanted.error();
    Expected<GltfDocument> document = GltfDocument::read(input, limits_of(job), context);
    if (!document) return document.error();
    FileSet files;
    if (Status status = files.writes(output); !status) return status.error();
    if (Status status = document->declare(files, output); !status) return status.error();
    const Expected<quadrig_status> done = remesh_document(job, *document, options, context);
    if (!done || *done == quadrig_out_of_memory) return done;
    if (Status status = document->add_to(files, output, context); !status) return status.error();
    if (Status status = files.commit(); !status) return status.error();
    return done;
  });
}

}  // extern "C"
