// quadrig remesh of a glTF file: its surfaces become quads, all else stays.
#include "remesh_gltf.hpp"

#include <numeric>

namespace quadrig::cli {
namespace {

/// All surfaces together, as the report of one surface.
RemeshReport together(std::span<const GltfRemeshed> all, const RemeshOptions& options) {
  RemeshReport sum;
  sum.scaled_jacobian_minimum = 1;
  Index largest = -1;
  for (const GltfRemeshed& one : all) {
    const RemeshReport& r = one.result.report;
    if (r.quads == 0) continue;
    sum.scaled_jacobian_average += r.scaled_jacobian_average * r.quads;
    sum.scaled_jacobian_minimum = std::min(sum.scaled_jacobian_minimum, r.scaled_jacobian_minimum);
    sum.quads += r.quads;
    sum.vertices += r.vertices;
    sum.irregular += r.irregular;
    sum.components.insert(sum.components.end(), r.components.begin(), r.components.end());
    sum.hinges.insert(sum.hinges.end(), r.hinges.begin(), r.hinges.end());
    sum.rims.insert(sum.rims.end(), r.rims.begin(), r.rims.end());
    sum.warnings.insert(sum.warnings.end(), r.warnings.begin(), r.warnings.end());
    sum.seconds += r.seconds;
    sum.fit += r.fit;
    sum.symmetry += r.symmetry;
    if (r.quads > largest) {
      largest = r.quads;
      sum.field = r.field;
      sum.backends = r.backends;
    }
  }
  if (sum.quads > 0) sum.scaled_jacobian_average /= sum.quads;
  Index triangles = 0;
  for (const GltfRemeshed& one : all) triangles += one.triangles;
  if (2 * sum.quads + triangles > 2 * options.quads * (1 + options.count_tolerance)) sum.minimum_count = sum.quads;
  return sum;
}

Index joints_of(const GltfRemeshed& one) {
  return one.surface.asset.rig ? one.surface.asset.rig->skeleton.bone_count() : 0;
}

Json input_json(const std::filesystem::path& path, std::span<const GltfRemeshed> all) {
  Index vertices = 0, faces = 0, bones = 0, components = 0, doubled = 0;
  bool closed = true;
  Json repairs = Json::array();
  for (const GltfRemeshed& one : all) {
    const TriangleMesh<double>& mesh = one.surface.asset.mesh;
    vertices += mesh.vertex_count();
    faces += mesh.face_count();
    bones += joints_of(one);
    components += one.surface.prepared.components;
    doubled += one.surface.prepared.doubled_vertices;
    closed = closed && mesh.closed();
    for (const std::string& repair : one.surface.repairs.sentences()) repairs.push_back(repair);
    for (const std::string& repair : one.surface.prepared.repairs()) repairs.push_back(repair);
  }
  return {{"mesh", path.string()},
          {"vertices", vertices},
          {"faces", faces},
          {"bones", bones},
          {"components", components},
          {"closed", closed},
          {"doubled_vertices", doubled},
          {"repairs", repairs}};
}

Json surfaces_json(std::span<const GltfRemeshed> all) {
  Json surfaces = Json::array();
  for (const GltfRemeshed& one : all) {
    Json failures = Json::array();
    for (const GltfFailure& failure : one.failures)
      failures.push_back({{"part", failure.part}, {"reason", failure.reason.message()}});
    Json shells = Json::array();
    for (const GltfShell& shell : one.shells)
      shells.push_back({{"part", shell.part},
                        {"make", gltf_make_name(shell.make)},
                        {"input_triangles", shell.input_triangles},
                        {"due", shell.due},
                        {"quads", shell.quads},
                        {"triangles", shell.triangles},
                        {"edge", shell.edge},
                        {"rms", shell.rms},
                        {"mean", shell.mean},
                        {"largest", shell.largest},
                        {"largest_unbent", shell.largest_unbent}});
    Json primitives = Json::array();
    for (const GltfPrimitive& primitive : one.primitives) {
      Json targets = Json::array();
      for (const GltfPrimitive::Target& target : primitive.targets)
        targets.push_back({{"target", target.target},
                           {"name", target.name},
                           {"mean", target.distance.mean},
                           {"largest", target.distance.largest}});
      primitives.push_back({{"mesh", primitive.mesh},
                            {"primitive", primitive.primitive},
                            {"input_triangles", primitive.input_triangles},
                            {"triangles", primitive.triangles},
                            {"edge", primitive.edge},
                            {"size", primitive.size},
                            {"mean", primitive.rest.mean},
                            {"largest", primitive.rest.largest},
                            {"targets", targets}});
    }
    const Index skin = one.surface.skin;
    surfaces.push_back({{"skin", skin == no_index ? Json(nullptr) : Json(skin)},
                        {"meshes", one.surface.meshes},
                        {"name", one.surface.name},
                        {"joints", joints_of(one)},
                        {"quads", one.result.report.quads},
                        {"triangles", one.triangles},
                        {"strayed", one.strayed},
                        {"kept_normals", one.kept_normals},
                        {"moved_vertices", one.moved_vertices},
                        {"shells", shells},
                        {"primitives", primitives},
                        {"passed_shells", one.passed_shells},
                        {"passed_triangles", one.passed_triangles},
                        {"failures", failures},
                        {"seam_edges", one.seam_edges},
                        {"snapped_edges", one.snapped_edges},
                        {"written_primitives", one.written_primitives},
                        {"written_vertices", one.written_vertices}});
  }
  return surfaces;
}

/// All quads in one mesh; surfaces whose meshes lie in spaces of their own keep them.
QuadMesh joined(std::span<const GltfRemeshed> all) {
  QuadMesh mesh;
  Index vertices = 0, quads = 0;
  for (const GltfRemeshed& one : all) {
    vertices += one.result.mesh.vertex_count();
    quads += one.result.mesh.quad_count();
  }
  mesh.positions.resize(vertices, 3);
  mesh.quads.resize(quads, 4);
  vertices = quads = 0;
  for (const GltfRemeshed& one : all) {
    const QuadMesh& part = one.result.mesh;
    mesh.positions.middleRows(vertices, part.vertex_count()) = part.positions;
    mesh.quads.middleRows(quads, part.quad_count()) = part.quads.array() + vertices;
    vertices += part.vertex_count();
    quads += part.quad_count();
  }
  return mesh;
}

/// One level of detail: adds its outputs to `files` and its line for people to `lines`.
/// \param triangles of the level before where that was to have no fewer quads, else 0; then those of this one
Status add_level(const GltfJob& job, const GltfDocument& input, double read_seconds,
                 std::span<const Warning> read_warnings, FileSet& files, std::string& lines, Index& triangles,
                 Session& session) {
  const Stopwatch watch;
  const std::size_t warned = session.context.warnings.size();
  GltfDocument document = input.copy();
  Expected<std::vector<GltfRemeshed>> all = remesh_gltf(document, job.options, session.context);
  // Rows come and go by many quads: a level that came out finer than the one before is asked for fewer.
  GltfRemeshOptions fewer = job.options;
  for (int again = 0; all && triangles > 0 && gltf_triangle_count(document) > triangles && again < 4; ++again) {
    fewer.remesh.quads = std::max<Index>(6, fewer.remesh.quads - fewer.remesh.quads / 20 - 1);
    session.context.warnings.resize(warned);
    document = input.copy();
    all = remesh_gltf(document, fewer, session.context);
  }
  if (!all) return all.error();
  triangles = gltf_triangle_count(document);
  RemeshReport sum = together(*all, job.options.remesh);
  sum.seconds.total = watch.seconds();
  if (Status status = document.add_to(files, job.output, session.context); !status) return status;
  if (!job.quads_out.empty())
    if (Status status = files.add(job.quads_out, obj_text(joined(*all))); !status) return status;
  if (!job.report.empty()) {
    Json report;
    report["quadrig"] = QUADRIG_VERSION;
    report["verb"] = "remesh";
    report["input"] = input_json(job.input, *all);
    report["options"] = job.options_json;
    std::vector<Warning> warnings(read_warnings.begin(), read_warnings.end());
    warnings.insert(warnings.end(), session.context.warnings.begin() + static_cast<std::ptrdiff_t>(warned),
                    session.context.warnings.end());
    add_remesh_figures(report, sum, read_seconds, warnings);
    report["triangles"] = triangles;
    report["surfaces"] = surfaces_json(*all);
    if (Status status = files.add(job.report, report_text(report, session)); !status) return status;
  }
  Index left = 0, strayed = 0;
  const GltfShell* farthest = nullptr;
  std::size_t failed = 0;
  for (const GltfRemeshed& one : *all) {
    left += one.triangles;
    for (const GltfShell& shell : one.shells)
      if (shell.edge > 0 &&
          (!farthest || shell.largest_unbent * farthest->edge > farthest->largest_unbent * shell.edge))
        farthest = &shell;
    strayed += one.strayed;
    failed += one.failures.size();
  }
  const double wanted = 2.0 * job.options.remesh.quads, got = 2.0 * sum.quads + left;
  lines += (lines.empty() ? "" : "\n") + job.output.string() + ": " + std::to_string(sum.quads) + " quads, " +
           (left > 0 ? std::to_string(left) + (left == 1 ? " triangle left, " : " triangles left, ") : "") +
           std::to_string(triangles) + " triangles in all, " + std::to_string(sum.irregular) +
           " irregular vertices, scaled Jacobian " + decimals(sum.scaled_jacobian_average, 3) + " on average and " +
           decimals(sum.scaled_jacobian_minimum, 3) + " at least, " + decimals(read_seconds + watch.seconds(), 2) +
           " s" +
           (farthest && farthest->largest_unbent > 0
                ? "; farthest from the input by " + decimals(farthest->largest_unbent / farthest->edge, 1) +
                      " edges: " + farthest->part
                : "") +
           (symmetry_words(sum.symmetry).empty() ? "" : "; " + symmetry_words(sum.symmetry)) +
           (strayed > 0 ? "; " + std::to_string(strayed) + (strayed == 1 ? " shell strays" : " shells stray") : "") +
           (failed > 0 ? "; " + std::to_string(failed) + (failed == 1 ? " part failed" : " parts failed") : "");
  const bool off = std::abs(got - wanted) > job.options.remesh.count_tolerance * wanted;
  session.in_part = session.in_part || failed > 0 || strayed > 0 || (job.strict_count && off);
  return {};
}

std::filesystem::path level_name(const std::filesystem::path& path, std::size_t level) {
  if (path.empty()) return path;
  std::filesystem::path name = path.stem();
  name += "_LOD" + std::to_string(level);
  name += path.extension();
  return path.parent_path() / name;
}

}  // namespace

Status remesh_gltf_file(const GltfJob& job, Session& session) {
  const Stopwatch watch;
  if (const Expected<GltfContainer> wanted = gltf_container(job.output); !wanted) return wanted.error();
  session.context.progress("read", 0);
  const Expected<GltfDocument> document = GltfDocument::read(job.input, {}, session.context);
  if (!document) return document.error();
  std::vector<std::filesystem::path> inputs = document->named_files();
  inputs.push_back(job.input);
  session.expect(inputs, static_cast<double>(std::accumulate(job.quads.begin(), job.quads.end(), std::int64_t{0})));
  const double read_seconds = watch.seconds();
  const std::vector<Warning> read_warnings = session.context.warnings;
  FileSet files;
  files.replaces_beside = job.force;
  for (const std::filesystem::path& path : {job.guides, job.rims})
    if (!path.empty())
      if (Status status = files.reads(path); !status) return status;
  std::vector<GltfJob> levels(job.quads.size(), job);
  for (std::size_t k = 0; k < levels.size(); ++k) {
    GltfJob& level = levels[k];
    level.options.remesh.quads = job.quads[k];
    level.options_json["quads"] = job.quads[k];
    if (levels.size() > 1)
      for (std::filesystem::path* path : {&level.output, &level.quads_out, &level.report}) *path = level_name(*path, k);
    Input input;
    input.files.mesh = job.input;
    if (Status status = declare(files, input, {level.output, level.report, level.quads_out}); !status) return status;
  }
  for (const GltfJob& level : levels)
    if (Status status = document->declare(files, level.output); !status) return status;
  std::string lines;
  Index triangles = 0;
  for (std::size_t k = 0; k < levels.size(); ++k) {
    const double part = 1 / static_cast<double>(levels.size()), begun = part * static_cast<double>(k);
    const ProgressPart progress(session.context, begun, begun + part);
    if (k > 0 && job.quads[k] > job.quads[k - 1]) triangles = 0;
    if (Status status = add_level(levels[k], *document, read_seconds, read_warnings, files, lines, triangles, session);
        !status)
      return status;
  }
  if (Status status = session.commit(files); !status) return status;
  session.say(lines);
  return {};
}

}  // namespace quadrig::cli
