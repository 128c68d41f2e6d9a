// quadrig remesh of a glTF file: the skinned surfaces become quads, all else stays.
#include "quadrig/gltf.hpp"

#include "remesh_gltf.hpp"

namespace quadrig::cli {
namespace {

/// All skins together, as the report of one surface.
RemeshReport together(std::span<const GltfRemeshed> all) {
  RemeshReport sum;
  sum.valid = true;
  sum.scaled_jacobian_minimum = 1;
  Index largest = -1;
  for (const GltfRemeshed& one : all) {
    const RemeshReport& r = one.result.report;
    if (r.quads == 0) continue;
    sum.valid = sum.valid && r.valid;
    sum.scaled_jacobian_average += r.scaled_jacobian_average * r.quads;
    sum.scaled_jacobian_minimum = std::min(sum.scaled_jacobian_minimum, r.scaled_jacobian_minimum);
    sum.quads += r.quads;
    sum.vertices += r.vertices;
    sum.irregular += r.irregular;
    sum.minimum_count += r.minimum_count;
    sum.components.insert(sum.components.end(), r.components.begin(), r.components.end());
    sum.warnings.insert(sum.warnings.end(), r.warnings.begin(), r.warnings.end());
    for (auto member : {&StageSeconds::metric, &StageSeconds::field, &StageSeconds::map, &StageSeconds::integers,
                        &StageSeconds::extraction, &StageSeconds::polish, &StageSeconds::transfer})
      sum.seconds.*member += r.seconds.*member;
    if (r.quads > largest) {
      largest = r.quads;
      sum.field = r.field;
    }
  }
  if (sum.quads > 0) sum.scaled_jacobian_average /= sum.quads;
  return sum;
}

Json input_json(const std::filesystem::path& path, std::span<const GltfRemeshed> all) {
  Index vertices = 0, faces = 0, bones = 0, components = 0, doubled = 0;
  bool closed = true;
  Json repairs = Json::array();
  for (const GltfRemeshed& one : all) {
    const TriangleMesh<double>& mesh = one.surface.asset.mesh;
    vertices += mesh.vertex_count();
    faces += mesh.face_count();
    bones += one.surface.asset.rig->skeleton.bone_count();
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

Json skins_json(std::span<const GltfRemeshed> all) {
  Json skins = Json::array();
  for (const GltfRemeshed& one : all)
    skins.push_back({{"skin", one.surface.skin},
                     {"name", one.surface.name},
                     {"joints", one.surface.asset.rig->skeleton.bone_count()},
                     {"quads", one.result.report.quads},
                     {"passed_shells", one.passed_shells},
                     {"passed_triangles", one.passed_triangles},
                     {"written_primitives", one.written_primitives},
                     {"written_vertices", one.written_vertices}});
  return skins;
}

/// All quads in one mesh; skins whose meshes lie in spaces of their own keep them.
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

}  // namespace

bool is_gltf(const std::filesystem::path& path) { return gltf_container(path).has_value(); }

Status remesh_gltf_file(const GltfJob& job, Session& session) {
  const Stopwatch watch;
  if (const Expected<GltfContainer> wanted = gltf_container(job.output); !wanted) return wanted.error();
  session.context.progress("read", 0);
  Expected<GltfDocument> document = GltfDocument::read(job.input, {}, session.context);
  if (!document) return document.error();
  const double read_seconds = watch.seconds();
  GltfRemeshOptions options;
  options.remesh = job.remesh;
  options.prepare = job.prepare;
  options.pose_source = job.clips ? GltfPoses::clips : GltfPoses::bends;
  const Expected<std::vector<GltfRemeshed>> all = remesh_gltf(*document, options, session.context);
  if (!all) return all.error();
  RemeshReport sum = together(*all);
  sum.seconds.total = watch.seconds() - read_seconds;
  if (!sum.valid)
    return Error{ErrorCode::stage_failed, "the quads break a rule of validity", "remesh", "ask for more quads"};

  FileSet files;
  if (Status status = document->add_to(files, job.output, session.context); !status) return status;
  if (!job.quads_out.empty())
    if (Status status = files.add(job.quads_out, obj_text(joined(*all))); !status) return status;
  if (!job.report.empty()) {
    Json report;
    report["quadrig"] = QUADRIG_VERSION;
    report["verb"] = "remesh";
    report["input"] = input_json(job.input, *all);
    report["options"] = job.options_json;
    add_remesh_figures(report, sum, read_seconds, session.context.warnings);
    report["skins"] = skins_json(*all);
    if (Status status = files.add(job.report, report.dump(2) + "\n"); !status) return status;
  }
  if (Status status = files.commit(); !status) return status;
  Index passed = 0;
  for (const GltfRemeshed& one : *all) passed += one.passed_shells;
  session.say(job.output.string() + ": " + std::to_string(sum.quads) + " quads, " + std::to_string(sum.irregular) +
              " irregular vertices, scaled Jacobian " + decimals(sum.scaled_jacobian_average, 3) + " on average and " +
              decimals(sum.scaled_jacobian_minimum, 3) + " at least, " + decimals(watch.seconds(), 2) + " s" +
              (passed > 0 ? "; " + std::to_string(passed) + " small shells left as they are" : ""));
  return {};
}

}  // namespace quadrig::cli
