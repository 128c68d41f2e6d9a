// quadrig stats: the figures of polygon meshes.
#include <map>

#include "quadrig/closest.hpp"
#include "quadrig/quality.hpp"
#include "remesh_gltf.hpp"

namespace quadrig::cli {
namespace {

struct StatsCommand {
  std::vector<std::filesystem::path> meshes;
  Input input;
  std::filesystem::path report;
  std::string poses = "bends", skinning = "linear";
  std::optional<Index> frames;  ///< poses at most
  Index samples = 40000;
  int subdivide = 0;
  bool own_weights = false;
  bool json = false;
  std::vector<std::string> least, most;  ///< KEY=VALUE
};

/// The rules that a mesh can be held against without its input; empty where all hold.
std::vector<std::string> broken_rules(const PolygonMesh& mesh, const MeshStatistics& s) {
  std::vector<std::string> broken;
  const auto rule = [&](Index count, const char* text) {
    if (count > 0) broken.push_back(std::to_string(count) + " " + text);
  };
  rule(s.triangles + s.ngons, "faces that are no quads");
  rule(s.degenerate_faces, "faces with a repeated vertex");
  rule(s.duplicate_faces, "duplicate faces");
  rule(s.nonmanifold_edges, "edges of more than two faces");
  rule(s.nonmanifold_vertices, "vertices of more than one fan");
  rule(s.misoriented_edges, "edges that both faces run the same way");
  rule(mesh.vertex_count() - s.vertices, "vertices of no face");
  if (s.quads > 0 && s.scaled_jacobian_minimum <= 0) broken.emplace_back("quads of scaled Jacobian 0 or less");
  return broken;
}

/// Polygons that are all quads, as a matrix.
std::optional<Quads> as_quads(const PolygonMesh& mesh) {
  Quads quads(mesh.polygon_count(), 4);
  for (Index i = 0; i < mesh.polygon_count(); ++i) {
    const auto polygon = mesh.polygon(i);
    if (polygon.size() != 4) return std::nullopt;
    for (int k = 0; k < 4; ++k) quads(i, k) = polygon[static_cast<std::size_t>(k)];
  }
  return quads;
}

Json row_json(const DeformationFigures::Row& row) {
  return {{"rms", row.rms}, {"p99", row.p99}, {"normal_degrees", row.normal_degrees}};
}

/// How the quads follow the rig. Vertices are taken to the closest point of the surface.
Expected<Json> guidance_json(const Asset& asset, QuadMesh quads) {
  const ClosestPoint surface(asset.mesh);
  for (Index v = 0; v < quads.vertex_count(); ++v)
    quads.source.push_back(surface.closest(quads.positions.row(v).transpose()));
  const Expected<GuidanceFigures> g = guidance_figures(asset.mesh, *asset.rig, quads);
  if (!g) return g.error();
  const auto name = [&](Index bone) { return asset.rig->skeleton.bones[static_cast<std::size_t>(bone)].name; };
  Json density = Json::object(), loops = Json::object();
  for (const RegionDensity& region : g->regions)
    density[region.bone == no_index ? "blending" : name(region.bone)] = region.density();
  for (Index b = 0; b < asset.rig->skeleton.bone_count(); ++b)
    if (asset.rig->skeleton.bones[static_cast<std::size_t>(b)].parent != no_index)
      loops[name(b)] = g->hinge_loops[static_cast<std::size_t>(b)];
  return Json{{"bone_angle_mean_degrees", g->bone_angle_mean_degrees},
              {"bone_angle_median_degrees", g->bone_angle_median_degrees},
              {"bone_angle_p99_degrees", g->bone_angle_p99_degrees},
              {"bone_edges", g->bone_edges},
              {"irregular_where_blending", g->irregular_where_blending},
              {"density", density},
              {"hinge_loops", loops}};
}

/// KEY=VALUE, the key a figure as the report has it, parts joined by dots.
struct Gate {
  std::string key;
  double bound = 0;
  bool least = true;
};
Expected<std::vector<Gate>> gates_of(const StatsCommand& options) {
  static const std::map<std::string, std::string> short_names{
      {"sj", "scaled_jacobian.minimum"},  {"sj_average", "scaled_jacobian.average"},
      {"farthest", "distance.hausdorff"}, {"rms", "distance.rms"},
      {"bent", "deformation.all.rms"},    {"joints", "deformation.joints.rms"}};
  std::vector<Gate> gates;
  for (const bool least : {true, false})
    for (const std::string& text : least ? options.least : options.most) {
      const std::size_t equals = text.find('=');
      Gate gate{text.substr(0, equals), 0, least};
      if (equals == std::string::npos || equals == 0 || !CLI::detail::lexical_cast(text.substr(equals + 1), gate.bound))
        return Error{ErrorCode::bad_option, "is no figure with a bound",
                     (least ? "--fail-below " : "--fail-above ") + text, "give KEY=VALUE such as sj=0.3"};
      if (const auto known = short_names.find(gate.key); known != short_names.end()) gate.key = known->second;
      gates.push_back(std::move(gate));
    }
  return gates;
}
/// The gates that the figures do not pass, in words. \fails bad_option where there is no such figure
Expected<std::vector<std::string>> failed_gates(const Json& figures, std::span<const Gate> gates) {
  std::vector<std::string> failed;
  for (const Gate& gate : gates) {
    const Json* value = &figures;
    for (std::size_t from = 0; value && from <= gate.key.size();) {
      const std::size_t dot = std::min(gate.key.find('.', from), gate.key.size());
      const auto found = value->is_object() ? value->find(gate.key.substr(from, dot - from)) : value->end();
      value = value->is_object() && found != value->end() ? &*found : nullptr;
      from = dot + 1;
    }
    if (!value || !value->is_number())
      return Error{ErrorCode::bad_option, "is no figure of these meshes", gate.key,
                   "--json prints all; distances and bending need --input"};
    const double figure = value->get<double>();
    if (gate.least ? figure < gate.bound : figure > gate.bound)
      failed.push_back(gate.key + " " + decimals(figure, 4) + " is " + (gate.least ? "below " : "above ") +
                       decimals(gate.bound, 4));
  }
  return failed;
}

/// A mesh file, or all that a glTF file draws.
Expected<PolygonMesh> read_polygons(const std::filesystem::path& path, const FileLimits& limits, FileSet& files,
                                    Session& session) {
  if (!is_gltf(path)) return read_surface(path, limits, session.context);
  const Expected<GltfDocument> document = read_document(path, files, session);
  if (!document) return document.error();
  return gltf_polygons(*document, session.context);
}

/// Where the weights of a mesh NAME.obj are: NAME-weights.dmat, or NAME.dmat.
std::filesystem::path weights_beside(const std::filesystem::path& mesh) {
  std::filesystem::path first = mesh, second = mesh;
  first.replace_extension("").concat("-weights.dmat");
  second.replace_extension(".dmat");
  std::error_code ignored;
  return std::filesystem::exists(first, ignored) ? first : second;
}
Expected<SkinWeights> read_skin_weights(const std::filesystem::path& path, const FileLimits& limits, Session& session) {
  const Expected<Eigen::MatrixXd> dense = read_dmat(path, limits, &session.context);
  if (!dense) return dense.error();
  return SkinWeights(dense->sparseView());
}

Expected<Json> figures(const std::filesystem::path& path, const StatsCommand& options, const LoadedAsset* input,
                       std::span<const Pose> poses, FileSet& files, Session& session) {
  const auto in_file = [&](Error error) {
    error.where = path.string() + (error.where.empty() ? "" : ", " + error.where);
    return error;
  };
  Expected<PolygonMesh> mesh = read_polygons(path, options.input.load.limits, files, session);
  if (!mesh) return mesh.error();
  const MeshStatistics s = mesh_statistics(*mesh);
  Json out;
  out["mesh"] = path.string();
  const std::vector<std::string> broken = broken_rules(*mesh, s);
  out["valid"] = broken.empty();
  out["broken_rules"] = broken;
  out["vertices"] = s.vertices;
  out["faces"] = s.faces;
  out["quads"] = s.quads;
  out["triangles"] = s.triangles;
  out["ngons"] = s.ngons;
  out["irregular"] = s.irregular;
  out["irregular_interior"] = s.irregular_interior;
  out["components"] = s.components;
  out["genus"] = s.genus ? Json(*s.genus) : Json(nullptr);
  out["euler"] = s.euler;
  out["boundary_edges"] = s.boundary_edges;
  out["boundary_loops"] = s.boundary_loops;
  out["scaled_jacobian"] = {{"average", s.scaled_jacobian_average},
                            {"minimum", s.scaled_jacobian_minimum},
                            {"negative", s.scaled_jacobian_negative}};
  if (const std::optional<Quads> quads = as_quads(*mesh); quads && quads->rows() > 0) {
    const ShapeStatistics shape = shape_statistics(mesh->positions, *quads);
    out["shape"] = {{"aspect_mean", shape.aspect_mean},
                    {"aspect_p99", shape.aspect_p99},
                    {"aspect_maximum", shape.aspect_maximum},
                    {"edge_ratio_mean", shape.edge_ratio_mean},
                    {"angle_error_mean_degrees", shape.angle_error_mean_degrees},
                    {"angle_error_p99_degrees", shape.angle_error_p99_degrees},
                    {"angle_error_maximum_degrees", shape.angle_error_maximum_degrees},
                    {"area_p99_by_p1", shape.area_p99_by_p1}};
  }
  if (!input) return out;
  const TriangleMesh<double>& surface = input->asset.mesh;
  std::optional<Subdivision> smooth;
  PolygonMesh drawn = *mesh;
  if (options.subdivide > 0) {
    const std::optional<Quads> cage = as_quads(*mesh);
    if (!cage || !broken.empty())
      return in_file({ErrorCode::bad_input, "only valid quads are a cage", "", "leave out --subdivide"});
    Expected<Subdivision> made =
        quadrig::subdivide(*cage, mesh->vertex_count(), {.levels = options.subdivide, .limit = false, .creases = {}});
    if (!made) return in_file(made.error());
    smooth = std::move(*made);
    drawn = to_polygons(QuadMesh{smooth->stencils * mesh->positions, smooth->quads, {}});
  }
  const Expected<SurfaceDistance> distance =
      surface_distance(surface.positions(), surface.faces(), drawn.positions, fan_triangles(drawn),
                       {options.samples, 7}, session.context);
  if (!distance) return in_file(distance.error());
  const double diagonal = surface.diagonal();
  out["distance"] = {{"hausdorff", distance->hausdorff() / diagonal},
                     {"rms", distance->to_input.rms / diagonal},
                     {"back_rms", distance->from_input.rms / diagonal}};
  if (!input->asset.rig) return out;
  const SkinWeights& weights = input->asset.rig->weights;
  Expected<SkinWeights> coarse = options.own_weights
                                     ? read_skin_weights(weights_beside(path), options.input.load.limits, session)
                                     : closest_weights(surface, weights, mesh->positions);
  if (!coarse) return in_file(coarse.error());
  DeformationOptions deformation;
  deformation.samples = options.samples;
  if (smooth) deformation.subdivision = &*smooth;
  if (options.skinning == "dual") deformation.skinning = Skinning::dual_quaternion;
  const Expected<DeformationFigures> d =
      deformation_error(surface, weights, *mesh, *coarse, poses, deformation, session.context);
  if (!d) return in_file(d.error());
  out["deformation"] = {{"poses", poses.size()},
                        {"joints", row_json(d->joints)},
                        {"all", row_json(d->all)},
                        {"back_rms", d->back_rms},
                        {"rest_joints_rms", d->rest_joints_rms},
                        {"rest_all_rms", d->rest_all_rms},
                        {"bent_rms", d->bent_rms},
                        {"bent_rest_rms", d->bent_rest_rms},
                        {"bent_normal_degrees", d->bent_normal_degrees},
                        {"flipped", d->flipped},
                        {"rest_volume", d->rest_volume},
                        {"posed_volume", d->posed_volume},
                        {"scaled_jacobian",
                         {{"average", d->scaled_jacobian_average},
                          {"minimum", d->scaled_jacobian_minimum},
                          {"negative", d->scaled_jacobian_negative}}}};
  if (broken.empty()) {
    const Expected<Json> guidance = guidance_json(input->asset, QuadMesh{mesh->positions, *as_quads(*mesh), {}});
    if (!guidance) return in_file(guidance.error());
    out["guidance"] = *guidance;
  }
  return out;
}

std::string as_text(const Json& figures) {
  std::string text = figures["mesh"].get<std::string>() + ": " + (figures["valid"].get<bool>() ? "valid" : "not valid");
  for (const Json& rule : figures["broken_rules"]) text += "\n  broken: " + rule.get<std::string>();
  if (figures.contains("failed"))
    for (const Json& gate : figures["failed"]) text += "\n  failed: " + gate.get<std::string>();
  const auto number = [](const Json& value) {
    if (!value.is_number_float()) return value.dump();
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.4g", value.get<double>());
    return std::string(buffer);
  };
  const auto line = [&](const std::string& name, const std::string& value) {
    text += "\n  " + name + std::string(name.size() < 28 ? 28 - name.size() : 1, ' ') + value;
  };
  for (const auto& [key, value] : figures.items()) {
    if (key == "mesh" || key == "valid" || key == "broken_rules" || key == "failed") continue;
    if (!value.is_object()) {
      line(key, number(value));
      continue;
    }
    std::string row;
    for (const auto& [name, figure] : value.items()) {
      if (figure.is_object()) {
        std::string inner;
        for (const auto& [part, x] : figure.items()) inner += (inner.empty() ? "" : ", ") + part + " " + number(x);
        line(key + " " + name, inner);
      } else {
        row += (row.empty() ? "" : ", ") + name + " " + number(figure);
      }
    }
    if (!row.empty()) line(key, row);
  }
  return text;
}

/// The poses asked for. \fails bad_option where clips are, and there are none; unsupported where there are too many
/// bones to bend each, since every bend has a transform of every bone
Expected<std::vector<Pose>> poses_of(const Rig& rig, const StatsCommand& options) {
  constexpr Index most_bones = 1000;
  if (options.poses == "bends" && rig.skeleton.bone_count() > most_bones)
    return Error{ErrorCode::unsupported,
                 std::to_string(rig.skeleton.bone_count()) + " bones are more than the " + std::to_string(most_bones) +
                     " that are bent one by one",
                 options.input.files.mesh.string(), "measure by clips (--poses clips), or without a rig"};
  if (options.poses == "bends") {
    constexpr Index most_bends = 128;
    std::vector<Pose> all = bend_poses(rig.skeleton, 60), poses;
    const auto most = static_cast<std::size_t>(options.frames.value_or(most_bends));
    if (all.size() <= most) return all;
    for (std::size_t k = 0; k < most; ++k) poses.push_back(std::move(all[k * all.size() / most]));
    return poses;
  }
  constexpr Index most_frames = 64;
  std::vector<Pose> poses = clip_poses(rig.clips, options.frames.value_or(most_frames));
  if (poses.empty())
    return Error{ErrorCode::bad_option, "has no clips", options.input.files.mesh.string(), "leave out --poses clips"};
  return poses;
}

Status stats(const StatsCommand& options, Session& session) {
  std::optional<LoadedAsset> input;
  FileSet files;
  for (const auto& path : options.meshes) {
    if (Status status = files.reads(path); !status) return status;
    if (options.own_weights)
      if (Status status = files.reads(weights_beside(path)); !status) return status;
  }
  if (Status status = declare(files, options.input, {options.report}); !status) return status;
  const std::filesystem::path& input_file = options.input.files.mesh;
  if (!is_gltf(input_file) && (options.poses != "bends" || !options.input.selection.names.empty()))
    return Error{ErrorCode::bad_option, "--poses and --select are for a glTF input", input_file.string(),
                 "leave them out"};
  const Expected<std::vector<Gate>> gates = gates_of(options);
  if (!gates) return gates.error();
  std::vector<Pose> poses;
  if (!options.input.files.mesh.empty()) {
    Input wanted = options.input;
    wanted.clips = options.poses == "clips";
    Expected<LoadedAsset> loaded = load(wanted, files, session);
    if (!loaded) return loaded.error();
    input = std::move(*loaded);
    if (input->asset.rig) {
      Expected<std::vector<Pose>> asked = poses_of(*input->asset.rig, options);
      if (!asked) return asked.error();
      poses = std::move(*asked);
    }
  }
  Json all = Json::array();
  for (const auto& path : options.meshes) {
    session.context.progress(path.filename().string(), static_cast<double>(all.size()) / double(options.meshes.size()));
    Expected<Json> one = figures(path, options, input ? &*input : nullptr, poses, files, session);
    if (!one) return one.error();
    if (!(*one)["valid"].get<bool>()) session.in_part = true;
    const Expected<std::vector<std::string>> failed = failed_gates(*one, *gates);
    if (!failed) return failed.error();
    if (!failed->empty()) session.in_part = true;
    if (!gates->empty()) (*one)["failed"] = *failed;
    all.push_back(std::move(*one));
  }
  Json report;
  report["quadrig"] = QUADRIG_VERSION;
  report["verb"] = "stats";
  report["meshes"] = all;
  // The figures first: where they cannot be printed no file is written either.
  session.clear_progress();
  if (options.json)
    session.print(report_text(report, session));
  else
    for (const Json& one : all) session.say(as_text(one));
  if (Status status = session.printed(); !status) return status;
  if (!options.report.empty())
    if (Status status = files.add(options.report, report_text(report, session)); !status) return status;
  if (Status status = session.commit(files); !status) return status;
  return {};
}

}  // namespace

void add_stats(CLI::App& app, Run& run) {
  auto options = std::make_shared<StatsCommand>();
  CLI::App* verb = app.add_subcommand("stats", "Counts, validity, shape, distance and bending of polygon meshes");
  verb->add_option("MESH", options->meshes, "Meshes: .obj, .off, .ply or .stl, or glTF files; -: standard input")
      ->required()
      ->transform(standard_input())
      ->type_name("");
  auto* input = verb->add_option("--input", options->input.files.mesh, "The surface that they stand for: distances");
  input->transform(standard_input())->type_name("FILE");
  auto* rig = verb->add_option("--rig", options->input.files.rig, "Its bones: how well the meshes bend");
  auto* weights = verb->add_option("--weights", options->input.files.weights, "Its skin weights");
  rig->transform(standard_input())->type_name("FILE")->needs(input)->needs(weights);
  weights->transform(standard_input())->type_name("FILE")->needs(rig);
  add_selection(*verb, options->input.selection, "Of a glTF input: the mesh, node, material or skin");
  verb->add_option("--poses", options->poses, "Bend every bone, or of a glTF input sample its own clips")
      ->check(CLI::IsMember({"bends", "clips"}))
      ->option_text("bends|clips = bends");
  verb->add_option("--frames", options->frames,
                   "Poses at most, evenly among all; 128 bends, or 64 of all clips together")
      ->check(CLI::Range(1, 100'000))
      ->type_name("N");
  verb->add_option("--skinning", options->skinning, "Linear blend, or dual quaternions")
      ->check(CLI::IsMember({"linear", "dual"}))
      ->option_text("linear|dual = linear");
  verb->add_option("--subdivide", options->subdivide,
                   "The meshes are cages: Catmull-Clark steps, after posing, before they are compared")
      ->check(CLI::Range(1, 4))
      ->expected(0, 1)
      ->default_str("2")
      ->type_name("STEPS = 2");
  verb->add_flag("--own-weights", options->own_weights,
                 "Pose MESH.obj by MESH-weights.dmat or MESH.dmat beside it, not by the input's at the closest points")
      ->needs(rig);
  verb->add_option("--samples", options->samples, "Points that distances are measured at")
      ->check(CLI::Range(100, 10'000'000))
      ->capture_default_str()
      ->type_name("N");
  verb->add_option("--fail-below", options->least,
                   "The exit code is 9 where a figure is less: sj=0.3, or its name in the report")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("KEY=VALUE[,…]");
  verb->add_option("--fail-above", options->most, "The same where it is more: irregular=50, farthest=0.01, bent=3")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("KEY=VALUE[,…]");
  verb->add_option("--report", options->report, "Write the figures as JSON")->type_name("FILE");
  verb->add_flag("--json", options->json, "Print the figures as JSON");
  verb->footer(R"(A mesh is valid where it is of quads alone, manifold and consistently oriented, without degenerate or
duplicate faces, and no quad has a scaled Jacobian of 0 or less. Distances are in diagonals of the input; bending
(each bone by 60 degrees both ways about two axes, or the clips of a glTF file) in 1e-4 of it. Guidance: the angle between edges and the bone that
rules them, quads a unit area by ruling bone (1: the mean), and closed edge loops round the joint where each bone hangs.

Examples:
  quadrig stats quads.obj
  quadrig stats a.obj b.obj --input arm.obj --rig arm.tgf --weights arm.dmat
  quadrig stats knight-quads.obj --input knight.glb --poses clips
  quadrig stats quads.glb --fail-below sj=0.3 --fail-above irregular=50
  quadrig stats quads.obj --json

The exit code is 9 where a mesh is not valid, or fails a figure asked for.)");
  verb->fallthrough();
  verb->callback([options, &run] { run = [options](Session& session) { return stats(*options, session); }; });
}

}  // namespace quadrig::cli
