// quadrig remesh: the whole way.
#include <charconv>

#include "map_obj.hpp"
#include "remesh_command.hpp"
#include "remesh_gltf.hpp"
#include "rims.hpp"

namespace quadrig::cli {
namespace {

Json factors_json(const std::vector<NamedFactor>& factors) {
  Json list = Json::array();
  for (const NamedFactor& each : factors) list.push_back({{"name", each.name}, {"factor", each.factor}});
  return list;
}

Json options_json(const RemeshCommand& o) {
  const auto unless_set = [](const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); };
  Json json = {{"quads", o.remesh.quads},
               {"preset", o.preset},
               {"bones", unless_set(o.remesh.directions.bones)},
               {"curvature", unless_set(o.remesh.directions.curvature)},
               {"posed", o.remesh.directions.posed}};
  if (o.remesh.sizing)
    json["sizing"] = {{"density", density_source_name(o.remesh.sizing->density)},
                      {"largest_aspect", o.remesh.sizing->largest_aspect},
                      {"joint_weight", o.remesh.sizing->joint_weight},
                      {"least_density", o.remesh.sizing->least_density},
                      {"largest_density", o.remesh.sizing->largest_density},
                      {"gradation", o.remesh.sizing->gradation}};
  else
    json["sizing"] = nullptr;
  json["bend_degrees"] = o.remesh.bend_degrees;
  const auto& crease = o.remesh.crease_angle_radians;
  json["crease_degrees"] = crease ? Json(*crease * 180 / std::numbers::pi) : Json(nullptr);
  json["max_error"] = o.max_error;
  json["keep"] = o.keep;
  json["fill_holes"] = o.remesh.fill_holes;
  json["for"] = o.bundle.empty() ? Json(nullptr) : Json(o.bundle);
  json["guides"] = o.guides.empty() ? Json(nullptr) : Json(o.guides.string());
  json["guide_width"] = o.guide_width;
  json["guide_weight"] = o.guide_weight;
  json["bone_density"] = factors_json(o.bone_density);
  json["material_density"] = factors_json(o.material_density);
  json["density_colors"] = o.density_colors;
  json["curl"] = o.remesh.curl_rounds;
  json["loops"] = o.remesh.loops.least;
  json["joint_loops"] = Json::object();
  for (const LoopOptions::OfJoint& one : o.remesh.loops.of_joints) json["joint_loops"][one.name] = one.loops;
  json["rims"] = o.rims;
  json["face_density"] = o.remesh.rims.face_density;
  json["fit"] = fit_method_name(o.remesh.fit.method);
  json["symmetry"] = o.remesh.symmetry ? Json(symmetry_choice_name(*o.remesh.symmetry)) : Json(nullptr);
  json["influences"] = o.remesh.influences;
  json["count_tolerance"] = o.remesh.count_tolerance;
  json["solver"] = o.remesh.solver.name;
  if (is_gltf(o.input.files.mesh)) {
    json["poses"] = o.poses;
    json["directions"] = o.directions;
    json["select"] = o.selection.names;
    json["all"] = o.selection.unskinned;
    json["source_map"] = o.source_map;
    json["seams"] = o.seams;
    json["topology"] = o.topology;
    json["normals"] = o.normals;
  }
  const PrepareOptions& prepare = o.input.load.prepare;
  json["weld"] = prepare.weld == Weld::never ? "never" : prepare.weld == Weld::all ? "all" : "seams";
  json["weld_distance"] = prepare.weld_distance;
  json["weight_tolerance"] = prepare.weight_tolerance;
  json["strict"] = prepare.strict;
  return json;
}

Json report_json(const RemeshCommand& options, const LoadedAsset& loaded, const RemeshReport& r, double read_seconds,
                 std::span<const Warning> warnings) {
  Json report = report_head("remesh", options.input, loaded);
  report["options"] = options_json(options);
  add_remesh_figures(report, r, read_seconds, warnings);
  return report;
}

/// The lines of an OBJ as curves. \fails as read_lines
Expected<std::vector<Guide>> read_guides(const std::filesystem::path& path, const FileLimits& limits, Context& context,
                                         double width, double weight) {
  Expected<std::vector<Polyline>> lines = read_lines(path, limits, context);
  if (!lines) return lines.error();
  std::vector<Guide> guides;
  for (Polyline& line : *lines) guides.push_back({std::move(line.points), line.closed, width, weight});
  return guides;
}

/// N, or NAME=N, in the order given.
Status read_loops(std::span<const std::string> given, LoopOptions& loops) {
  for (const std::string& one : given) {
    const std::size_t equals = one.rfind('=');
    const std::string_view number = std::string_view(one).substr(equals == std::string::npos ? 0 : equals + 1);
    Index count = 0;
    const auto [end, fault] = std::from_chars(number.data(), number.data() + number.size(), count);
    if (fault != std::errc{} || end != number.data() + number.size() || count < 0 || equals == 0)
      return Error{ErrorCode::bad_option, "is no number of loops, nor a joint with one", "--loops " + one,
                   "give a number such as 3, or NAME=5"};
    if (equals == std::string::npos)
      loops.least = count;
    else
      loops.of_joints.push_back({one.substr(0, equals), count});
  }
  return {};
}

/// \param text an angle in degrees, "none" or "flats" \fails bad_option on all else
Status set_creases(const std::string& text, RemeshOptions& options) {
  if (text == "flats") return {};
  double degrees = 180;
  if (text != "none") {
    const char* end = text.data() + text.size();
    const auto [rest, fault] = std::from_chars(text.data(), end, degrees);
    if (fault != std::errc() || rest != end || !(degrees >= 0.01 && degrees <= 180))
      return Error{ErrorCode::bad_option, "is no angle", "--creases " + text,
                   "give 0.01 to 180 degrees, none, or flats"};
  }
  options.crease_angle_radians = degrees * std::numbers::pi / 180;
  return {};
}

Json symmetry_json(const SymmetryReport& s) {
  Json json = {{"choice", symmetry_choice_name(s.choice)}, {"plane", nullptr}};
  if (!s.plane) return json;
  const MirrorPlane& p = *s.plane;
  json["plane"] = {{"normal", {p.normal[0], p.normal[1], p.normal[2]}},
                   {"offset", p.offset},
                   {"tolerance", p.tolerance},
                   {"share", p.share},
                   {"near_share", p.near_share},
                   {"deviation", p.deviation},
                   {"paired_bones", p.twin.empty() ? Json(nullptr) : Json(p.paired_bones)}};
  json["components"] = {{"halved", s.halved}, {"paired", s.paired}, {"whole", s.whole}};
  json["pairs"] = s.vertices.pairs;
  json["exact"] = s.vertices.exact;
  return json;
}

}  // namespace

Status remesh_files(RemeshCommand options, Session& session) {
  const Input& input = options.input;
  const std::filesystem::path& weights_out = options.weights_out;
  const bool gltf = is_gltf(input.files.mesh);
  if (!gltf && !goes_to(options.output, ".obj"))
    return Error{ErrorCode::bad_option,
                 "the quads of " + input.files.mesh.extension().string() + " files can only be written as OBJ",
                 options.output.string(), "give a name that ends in .obj"};
  if (gltf && (!weights_out.empty() || !input.files.rig.empty()))
    return Error{ErrorCode::bad_option, "a glTF file has its rig and weights within", input.files.mesh.string(),
                 "leave out --rig, --weights and --weights-out"};
  if (!gltf && (!options.quads_out.empty() || options.poses != "bends" || options.source_map ||
                options.selection.unskinned || options.directions != "rest" || !options.selection.names.empty() ||
                !options.seams || options.topology != "best" || options.normals != "auto"))
    return Error{ErrorCode::bad_option,
                 "--quads-out, --poses, --directions, --select, --all, --source-map, --no-seams, --topology and "
                 "--normals are for glTF files",
                 input.files.mesh.string(), "leave them out"};
  if (!options.quads_out.empty() && !goes_to(options.quads_out, ".obj"))
    return Error{ErrorCode::bad_option, "quads can only be written as OBJ", options.quads_out.string(),
                 "give a name that ends in .obj"};
  if (!options.map_out.empty() && (gltf || !goes_to(options.map_out, ".obj")))
    return Error{ErrorCode::bad_option,
                 gltf ? "--map-out is not available for glTF files" : "the map can only be written as OBJ",
                 options.map_out.string(), gltf ? "leave it out" : "give a name that ends in .obj"};
  if (!gltf && options.quads.size() > 1)
    return Error{ErrorCode::bad_option, "several counts are for glTF files", input.files.mesh.string(), "give one"};
  if (options.quads.empty() || options.quads.size() > 16)
    return Error{ErrorCode::bad_option, options.quads.empty() ? "is empty" : "are more than 16 counts", "--quads",
                 options.quads.empty() ? "give a count" : "give fewer"};
  for (const std::filesystem::path* path : {&options.output, &options.quads_out, &options.report})
    if (options.quads.size() > 1 && *path == "-")
      return Error{ErrorCode::bad_option, "several counts have no room on standard output", "--quads",
                   "give one, or name a file"};
  options.remesh.quads = options.quads.front();
  options.input.quads = options.remesh.quads;
  if (!weights_out.empty() && input.files.rig.empty())
    return Error{ErrorCode::bad_option, "weights asked of an asset without a rig", weights_out.string(),
                 "give --rig and --weights"};
  const Expected<FieldPreset> preset = field_preset(options.preset);
  if (!preset) return preset.error();
  options.remesh.preset = *preset;
  if (!options.density.empty()) {
    const Expected<DensitySource> density = density_source(options.density);
    if (!density) return density.error();
    options.sizing.density = *density;
    if (*density == DensitySource::uniform && !options.aspect_given) options.sizing.largest_aspect = 1;
    options.remesh.sizing = options.sizing;
  }
  if (Status status = set_creases(options.creases, options.remesh); !status) return status;
  options.remesh.group_borders = options.keeps("groups");
  options.remesh.exact_borders = options.keeps("borders");
  if (gltf && options.remesh.fill_holes > 0)
    return Error{ErrorCode::bad_option, "--fill-holes is not available for glTF files", input.files.mesh.string(),
                 "leave it out"};
  if (!gltf && !options.bone_density.empty() && input.files.rig.empty())
    return Error{ErrorCode::bad_option, "needs bones", "--bone-density", "give --rig, or leave it out"};
  options.input.load.density = {options.material_density, options.density_colors};
  options.input.load.keep = {options.keeps("materials"), options.keeps("textures"), options.keeps("lines")};
  if (gltf && options.keeps("lines"))
    return Error{ErrorCode::bad_option, "--keep lines is for OBJ files", input.files.mesh.string(), "leave it out"};
  if (Status status = read_loops(options.loops, options.remesh.loops); !status) return status;
  if (Status status = read_rims(options.rims, options.input.load.limits, session.context, options.remesh.rims); !status)
    return status;
  if (Status status = options.remesh.validate(); !status) return status;
  if (options.input.load.bind) {
    options.input.load.bind->influences = options.remesh.influences;
    options.input.load.bind->solver = options.remesh.solver.name;
  }

  if (!options.guides.empty()) {
    Expected<std::vector<Guide>> guides = read_guides(options.guides, options.input.load.limits, session.context,
                                                      options.guide_width, options.guide_weight);
    if (!guides) return guides.error();
    options.remesh.guides = std::move(*guides);
  }
  if (gltf) {
    GltfJob job;
    job.input = input.files.mesh;
    job.guides = options.guides;
    if (!options.remesh.rims.own.empty()) job.rims = options.rims;
    job.output = options.output;
    job.report = options.report;
    job.quads_out = options.quads_out;
    job.quads = options.quads;
    job.options.remesh = options.remesh;
    job.options.prepare = input.load.prepare;
    job.options.selection = options.selection;
    job.options.pose_source = options.poses == "clips" ? GltfPoses::clips : GltfPoses::bends;
    job.options.clip_directions = options.directions == "clips";
    job.options.source_map = options.source_map;
    job.options.snap_seams = options.seams;
    // The thesis's method is that of a field.
    const bool field = options.topology == "field" || options.remesh.preset == FieldPreset::thesis;
    job.options.topology = field ? GltfTopology::field : GltfTopology::best;
    job.options.normals = options.normals == "keep"  ? GltfNormals::keep
                          : options.normals == "new" ? GltfNormals::fresh
                                                     : GltfNormals::automatic;
    job.options.most_edges_off = options.max_error;
    job.options.bone_density = options.bone_density;
    job.options.material_density = options.material_density;
    job.options.density_colors = options.density_colors;
    job.options.keep_materials = options.keeps("materials");
    job.options.keep_textures = options.keeps("textures");
    job.options_json = options_json(options);
    job.force = options.force;
    job.strict_count = options.strict_count;
    return remesh_gltf_file(job, session);
  }

  if (options.force)
    return Error{ErrorCode::bad_option, "--force is for glTF files, which name others", input.files.mesh.string(),
                 "leave it out"};
  FileSet files;
  if (Status status = declare(files, input, {options.output, options.report, weights_out}); !status) return status;
  if (!options.guides.empty())
    if (Status status = files.reads(options.guides); !status) return status;
  if (!options.remesh.rims.own.empty())
    if (Status status = files.reads(options.rims); !status) return status;
  const Stopwatch watch;
  const Expected<LoadedAsset> loaded = load(input, files, session);
  if (!loaded) return loaded.error();
  const double read_seconds = watch.seconds();
  options.remesh.features = loaded->features;
  options.remesh.density_factors = loaded->density_factors;
  if (!options.bone_density.empty()) {
    std::vector<std::string> names;
    for (const Bone& bone : loaded->asset.rig->skeleton.bones) names.push_back(bone.name);
    Expected<std::vector<double>> factors = named_factors(options.bone_density, names, "bone");
    if (!factors) return factors.error();
    options.remesh.bone_density = std::move(*factors);
  }
  options.remesh.keep_maps = !options.map_out.empty();
  const Expected<RemeshResult> result = remesh(loaded->asset, options.remesh, session.context);
  if (!result) return result.error();
  const RemeshReport& r = result->report;

  if (Status status = files.add(options.output, obj_text(result->mesh)); !status) return status;
  if (!weights_out.empty()) {
    const DmatFormat format = options.binary_weights ? DmatFormat::binary : DmatFormat::ascii;
    if (Status status = files.add(weights_out, dmat_text(*result->weights, format)); !status) return status;
  }
  if (!options.map_out.empty()) {
    if (result->maps.empty())
      return Error{ErrorCode::stage_failed, "no component has a map: all were split", options.map_out.string(),
                   "ask for more quads, or leave out --map-out"};
    if (Status status = files.add(options.map_out, map_obj_text(result->maps)); !status) return status;
  }
  if (!options.report.empty()) {
    const Json report = report_json(options, *loaded, r, read_seconds, session.context.warnings);
    if (Status status = files.add(options.report, report_text(report, session)); !status) return status;
  }
  if (Status status = session.commit(files); !status) return status;
  const double off = std::abs(static_cast<double>(r.quads) / options.remesh.quads - 1);
  session.in_part = options.strict_count && off > options.remesh.count_tolerance;
  const auto strays = [&](const ComponentReport& part) { return part.farthest > options.max_error * part.edge; };
  if (options.max_error > 0 && std::ranges::any_of(r.components, strays)) session.in_part = true;
  std::string line =
      options.output.string() + ": " + std::to_string(r.quads) + " quads, " + std::to_string(r.irregular) +
      " irregular vertices, scaled Jacobian " + decimals(r.scaled_jacobian_average, 3) + " on average and " +
      decimals(r.scaled_jacobian_minimum, 3) + " at least, " + decimals(read_seconds + r.seconds.total, 2) + " s";
  if (const std::string words = symmetry_words(r.symmetry); !words.empty()) line += "; " + words;
  session.say(line);
  return {};
}

std::string symmetry_words(const SymmetryReport& s) {
  if (!s.plane) return {};
  const Vector3 n = s.plane->normal;
  Eigen::Index axis = 0;
  n.cwiseAbs().maxCoeff(&axis);
  constexpr double upright = 0.9999;
  std::string words = "mirrored across ";
  if (n[axis] > upright)
    words += std::string(1, static_cast<char>('x' + axis));
  else
    words += "a plane near " + std::string(1, static_cast<char>('x' + axis));
  if (s.halved + s.paired == 0) return "a mirror plane, but no part that is mirrored";
  const double share = s.vertices.pairs > 0 ? static_cast<double>(s.vertices.exact) / s.vertices.pairs : 0;
  words += " (" + decimals(100 * share, 1) + " % of the vertices exactly";
  if (s.whole > 0) words += ", " + std::to_string(s.whole) + (s.whole == 1 ? " part not" : " parts not");
  return words + ")";
}

Json curl_json(const CurlReport& curl) {
  return {{"rounds", curl.rounds},
          {"mean_before", curl.mean_before},
          {"mean_after", curl.mean_after},
          {"largest_before", curl.largest_before},
          {"largest_after", curl.largest_after},
          {"turned_mean_degrees", curl.turned_mean_degrees},
          {"turned_p95_degrees", curl.turned_p95_degrees},
          {"scaled_mean", curl.scaled_mean},
          {"scaled_p95", curl.scaled_p95}};
}

void add_remesh_figures(Json& report, const RemeshReport& r, double read_seconds, std::span<const Warning> warnings) {
  report["quads"] = r.quads;
  report["vertices"] = r.vertices;
  report["irregular"] = r.irregular;
  report["scaled_jacobian"] = {{"average", r.scaled_jacobian_average}, {"minimum", r.scaled_jacobian_minimum}};
  report["minimum_count"] = r.minimum_count;
  report["components"] = Json::array();
  for (const ComponentReport& c : r.components)
    report["components"].push_back({{"faces", c.faces},
                                    {"asked", c.asked},
                                    {"quads", c.quads},
                                    {"irregular", c.irregular},
                                    {"singularities", c.singularities},
                                    {"rung", rung_name(c.rung)},
                                    {"map",
                                     {{"curl_mean", c.strain.curl_mean},
                                      {"curl_largest", c.strain.curl_largest},
                                      {"turned_mean_degrees", c.strain.turned_mean_degrees},
                                      {"turned_p95_degrees", c.strain.turned_p95_degrees},
                                      {"scaled_mean", c.strain.scaled_mean},
                                      {"scaled_p95", c.strain.scaled_p95}}},
                                    {"curl", curl_json(c.curl)},
                                    {"kept_length", c.kept_length},
                                    {"kept_as_quads", c.kept_as_quads},
                                    {"edge", c.edge},
                                    {"farthest", c.farthest},
                                    {"farthest_place", {c.farthest_place[0], c.farthest_place[1], c.farthest_place[2]}},
                                    {"share_missed", c.share_missed},
                                    {"area_ratio", c.area_ratio},
                                    {"reasons", c.reasons}});
  report["hinges"] = Json::array();
  for (const HingeReport& hinge : r.hinges)
    report["hinges"].push_back({{"joint", hinge.joint},
                                {"wanted", hinge.wanted},
                                {"loops", hinge.rings.loops},
                                {"around", hinge.rings.around},
                                {"poles", hinge.rings.poles},
                                {"quads_for", hinge.quads_for}});
  report["rims"] = rims_json(r.rims);
  report["gaps"] = {{"notches", r.gaps.notches},
                    {"notch_share", r.gaps.notch_share},
                    {"holes_filled", r.gaps.holes_filled},
                    {"holes_cut", r.gaps.holes_cut},
                    {"holes_closed", r.gaps.holes_closed}};
  report["field"] = {{"preset", field_preset_name(r.field.preset)},
                     {"singularities_plus", r.field.singularities_plus},
                     {"singularities_minus", r.field.singularities_minus},
                     {"index_sum", r.field.index_sum},
                     {"mean_angle_to_bone_deg", r.field.mean_angle_to_bone_deg},
                     {"residual", r.field.solve.residual}};
  report["fit"] = {{"rest_before", r.fit.rest_before},    {"rest_after", r.fit.rest_after},
                   {"back_before", r.fit.back_before},    {"back_after", r.fit.back_after},
                   {"posed_before", r.fit.posed_before},  {"posed_after", r.fit.posed_after},
                   {"largest_move", r.fit.largest_move},  {"dropped_influences", r.fit.dropped_influences},
                   {"dropped_error", r.fit.dropped_error}};
  report["symmetry"] = symmetry_json(r.symmetry);
  report["solvers"] = {{"field", r.backends.field},
                       {"surgery", r.backends.surgery},
                       {"target", r.backends.target},
                       {"map", r.backends.map},
                       {"untangling", r.backends.untangling}};
  report["seconds"] = {{"read", read_seconds},
                       {"metric", r.seconds.metric},
                       {"pieces", r.seconds.pieces},
                       {"field", r.seconds.field},
                       {"map", r.seconds.map},
                       {"integers", r.seconds.integers},
                       {"extraction", r.seconds.extraction},
                       {"polish", r.seconds.polish},
                       {"fit", r.seconds.fit},
                       {"transfer", r.seconds.transfer},
                       {"total", read_seconds + r.seconds.total}};
  Json all = warnings_json(warnings);
  for (const Json& warning : warnings_json(r.warnings))
    if (std::find(all.begin(), all.end(), warning) == all.end()) all.push_back(warning);
  report["warnings"] = all;
}

}  // namespace quadrig::cli
